"""Luma of decoded video frames: upright, full range, whatever the pixel format."""

from typing import Any

import av
import cv2
import numpy as np

_ROTATIONS = {
    90: cv2.ROTATE_90_COUNTERCLOCKWISE,
    -90: cv2.ROTATE_90_CLOCKWISE,
    180: cv2.ROTATE_180,
    -180: cv2.ROTATE_180,
}


_FULL_RANGE = 2
"""FFmpeg's number of the colour range from 0 to the largest value (AVCOL_RANGE_JPEG)."""
_BLACK, _WHITE_ABOVE_BLACK = 16, 219
"""Black of limited range, and the distance to its white, in 8 bits (ITU-R BT.601)."""


class LumaConverter:
    """Converts frames of one pixel format to upright full-range luma; shape: (height, width), upright."""

    def __init__(self, frame: av.VideoFrame) -> None:
        self._format = (frame.format.name, frame.width, frame.height, frame.color_range, frame.rotation)
        depth = frame.format.components[0].bits
        self._wide = depth > 8
        self.bits = 16 if self._wide else 8
        self._rotation = _ROTATIONS.get(round(frame.rotation / 90) * 90)
        is_sideways = self._rotation in (cv2.ROTATE_90_CLOCKWISE, cv2.ROTATE_90_COUNTERCLOCKWISE)
        self.shape = (frame.width, frame.height) if is_sideways else (frame.height, frame.width)
        self._planar = _has_luma_plane(frame.format)
        self._table = _full_range(depth, limited=_is_limited(frame)) if self._planar else None

    def is_same_format(self, frame: av.VideoFrame) -> bool:
        """Return whether a frame has the format of the first one."""
        return self._format == (frame.format.name, frame.width, frame.height, frame.color_range, frame.rotation)

    def convert(self, frame: av.VideoFrame) -> np.ndarray:
        """Return a frame's luma (H, W), uint8 or uint16, as a copy."""
        if self._planar:
            plane = frame.planes[0]
            dtype = np.dtype("<u2") if self._wide else np.dtype(np.uint8)
            # A plane's rows are padded to `line_size` bytes.
            rows = np.frombuffer(plane, dtype).reshape(-1, plane.line_size // dtype.itemsize)
            luma = rows[: frame.height, : frame.width]
            if self._table is None:
                luma = luma.copy()
            else:
                luma = self._table[luma] if self._wide else cv2.LUT(luma, self._table)
        else:
            luma = cv2.cvtColor(frame.to_ndarray(format="bgr48le" if self._wide else "bgr24"), cv2.COLOR_BGR2GRAY)
        return luma if self._rotation is None else cv2.rotate(luma, self._rotation)


def eight_bits(luma: np.ndarray) -> np.ndarray:
    """Return luma (..) of 8 or 16 bits as uint8."""
    return luma if luma.dtype == np.uint8 else (luma // 257).astype(np.uint8)


def _has_luma_plane(pixels: Any) -> bool:
    """Return whether the first plane holds only luma or grey, little endian: planar yuv, nv12, gray."""
    name = pixels.name
    is_planar = name.startswith(("yuv4", "yuvj4", "yuva4", "gray", "nv12", "nv21", "nv16", "nv24"))
    return is_planar and not name.endswith("be") and not name.startswith(("yuyv", "grayf"))


def _is_limited(frame: av.VideoFrame) -> bool:
    """Return whether luma runs from 16 to 235, as it does unless the file states full range or the format is grey."""
    name = frame.format.name
    if name.startswith(("yuvj", "gray")):
        return False
    return int(frame.color_range) != _FULL_RANGE


def _full_range(depth: int, limited: bool) -> np.ndarray | None:
    """Return the table from the file's luma to 0..255 or 0..65535; None if nothing changes."""
    if not limited and depth in (8, 16):
        return None
    codes = np.arange(256 if depth == 8 else 65536, dtype=np.float64)
    unit = 2.0 ** (depth - 8)
    value = (codes - _BLACK * unit) / (_WHITE_ABOVE_BLACK * unit) if limited else codes / (2.0**depth - 1)
    top = 255 if depth == 8 else 65535
    return np.round(value.clip(0, 1) * top).astype(np.uint8 if depth == 8 else np.uint16)
