"""Thumbnails: the whole frame over time, some hundred small pictures, taken while the video is decoded."""

from collections.abc import Iterator, Mapping

import cv2
import numpy as np

from glint.storage.footage.luma import eight_bits
from glint.storage.footage.source import Footage
from glint.storage.footage.wrapper import FootageWrapper

MIN_THUMBNAILS = 128
"""Thumbnails that a capture has at least, if it has as many frames; at most twice as many."""
UNKNOWN_LENGTH_INTERVAL = 16
"""Frames from one thumbnail to the next of a video that does not state its length."""
THUMBNAIL_PX = 48
"""Width of a thumbnail in pixels."""
PICTURES, NUMBERS = "thumbnails", "thumbnail_frames"
"""Arrays of the stage `frames`: (N, h, w) uint8, 0 to 255, and the number (N,) of each one's frame."""


class ThumbnailRecorder(FootageWrapper):
    """A video that keeps a thumbnail of every so many frames that pass."""

    def __init__(self, footage: Footage) -> None:
        """Watch a video."""
        super().__init__(footage)
        self._interval = max(1, footage.count // MIN_THUMBNAILS) if footage.count else UNKNOWN_LENGTH_INTERVAL
        self._pictures: dict[int, np.ndarray] = {}

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .."""
        for number, frame in enumerate(self._footage.frames(start, step)):
            if (start + number * step) % self._interval == 0:
                self._pictures[start + number * step] = _thumbnail(frame)
            yield frame

    def arrays(self) -> Mapping[str, np.ndarray]:
        """Return the arrays to save; frames that did not pass, since they were cached, are decoded."""
        if 0 not in self._pictures:
            for _ in self.frames(step=self._interval):
                pass
        numbers = sorted(self._pictures)
        return {
            PICTURES: np.stack([self._pictures[number] for number in numbers]),
            NUMBERS: np.array(numbers, np.int64),
        }


def thumbnail_grid(shape: tuple[int, ...], frame_size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return column and row (h, w), in pixels of the full frame, of the middle of each pixel of a thumbnail.

    shape: (h, w) of the thumbnail; frame_size: (width, height).
    """
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return (columns + 0.5) * frame_size[0] / shape[1] - 0.5, (rows + 0.5) * frame_size[1] / shape[0] - 0.5


def _thumbnail(frame: np.ndarray) -> np.ndarray:
    height, width = frame.shape
    size = (min(THUMBNAIL_PX, width), max(1, round(min(THUMBNAIL_PX, width) * height / width)))
    small = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    return eight_bits(small)
