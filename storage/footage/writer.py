"""Write a video: H.264 of full-range grey frames."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

_LIMITED_RANGE = np.round(16 + 219 * np.arange(256) / 255).astype(np.uint8)
"""A video's luma runs from 16 to 235."""
_NEUTRAL_CHROMA = 128


def write_video(path: Path, frames: Iterable[np.ndarray], width: int, height: int, rate: int, crf: int) -> None:
    """Encode luma frames (height, width), uint8 and full range, as H.264.

    rate: frames per second; crf: the encoder's constant rate factor, 0 best and 51 worst. The same frames give the same
    file, byte for byte.
    """
    with av.open(str(path), "w") as container:
        # With the encoder's macroblock tree, equal frames would not always give equal files.
        options = {"crf": str(crf), "preset": "veryfast", "x264-params": "mbtree=0"}
        stream = container.add_stream("libx264", rate=rate, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.time_base = Fraction(1, rate)
        for frame in frames:
            container.mux(stream.encode(_grey_frame(frame)))
        container.mux(stream.encode())


def _grey_frame(luma: np.ndarray) -> av.VideoFrame:
    """Return a frame that owns its buffer, row padding included, since the encoder reads it asynchronously."""
    frame = av.VideoFrame(luma.shape[1], luma.shape[0], "yuv420p")
    luma_plane, *chroma_planes = frame.planes
    rows = np.full((luma_plane.height, luma_plane.line_size), 16, np.uint8)
    rows[:, : luma.shape[1]] = cv2.LUT(luma, _LIMITED_RANGE)
    luma_plane.update(rows.tobytes())
    for plane in chroma_planes:
        plane.update(np.full((plane.height, plane.line_size), _NEUTRAL_CHROMA, np.uint8).tobytes())
    return frame
