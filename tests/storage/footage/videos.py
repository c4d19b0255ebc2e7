"""Videos and images whose pixels are known, for tests."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np


def ramp(index: int, height: int = 48, width: int = 64) -> np.ndarray:
    """Frame number `index`: a slope from left to right, a bright block that wanders and a dark one at the top left.

    Whenever the block begins again at the left it is a level darker, so that no two frames are the same.
    """
    frame = np.tile(np.linspace(30, 200, width), (height, 1))
    column = 4 * (index % (width // 4))
    frame[height // 2 : height // 2 + 8, column : column + 4] = 250 - index // (width // 4)
    frame[2:8, 2:8] = 5
    return frame.astype(np.uint8)


def write_video(
    path: Path,
    frames: Sequence[np.ndarray],
    codec: str = "libx264",
    pixels: str = "yuv420p",
    times: Sequence[int] | None = None,
    options: dict[str, str] | None = None,
    container_options: dict[str, str] | None = None,
    full_range: bool = False,
) -> Path:
    """Write luma frames (uint8 or uint16, full range) as a video; `times` in milliseconds (default: every 40).

    AVI has a slot every 40 ms; slots without a frame are empty.
    """
    with av.open(str(path), "w", options=container_options or {}) as container:
        stream: Any = container.add_stream(codec, rate=25, options=options or {})
        stream.height, stream.width = frames[0].shape
        stream.pix_fmt = pixels
        unit = 40 if path.suffix == ".avi" else 1
        stream.codec_context.time_base = Fraction(unit, 1000)
        if full_range:
            stream.codec_context.color_range = 2
        for index, luma in enumerate(frames):
            frame = av.VideoFrame(luma.shape[1], luma.shape[0], pixels)
            _fill(frame, luma, pixels, full_range)
            frame.pts = (times[index] if times else 40 * index) // unit
            frame.time_base = Fraction(unit, 1000)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def _fill(frame: av.VideoFrame, luma: np.ndarray, pixels: str, full_range: bool) -> None:
    depth = frame.format.components[0].bits
    kind = np.uint8 if depth == 8 else np.dtype("<u2")
    top = np.iinfo(luma.dtype).max
    unit = 2.0 ** (depth - 8)
    full = full_range or pixels.startswith(("gray", "yuvj"))
    codes = luma / top * (2.0**depth - 1) if full else (16 + 219 * (luma / top)) * unit
    for number, plane in enumerate(frame.planes):
        values = np.full((plane.height, plane.line_size // np.dtype(kind).itemsize), 128 * unit, kind)
        if number == 0:
            values[:, : luma.shape[1]] = np.round(codes)
        plane.update(values.tobytes())


def turn(path: Path, degrees: int) -> None:
    """Set the rotation flag of an MP4 file, clockwise, as phones do."""
    data = bytearray(path.read_bytes())
    start = data.index(b"tkhd") + 4
    matrix = start + (40 if data[start] == 0 else 52)
    cosine, sine = round(np.cos(np.radians(degrees))), round(np.sin(np.radians(degrees)))
    for place, value in ((0, cosine), (4, sine), (12, -sine), (16, cosine)):
        data[matrix + place : matrix + place + 4] = int(value * 65536).to_bytes(4, "big", signed=True)
    path.write_bytes(data)


def write_images(folder: Path, frames: Sequence[np.ndarray], pattern: str = "img_{}.png") -> list[Path]:
    """Write images numbered from 1, without leading zeros."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / pattern.format(number) for number in range(1, len(frames) + 1)]
    for path, frame in zip(paths, frames, strict=True):
        assert cv2.imwrite(str(path), frame)
    return paths
