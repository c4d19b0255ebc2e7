"""Frames spread over a video, reduced so that they fit in memory, and the mask that is estimated from them."""

from collections.abc import Sequence

import cv2
import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.masks.mask import estimate_mask

MAX_SAMPLE_BYTES = 256 << 20
"""Bytes that reduced frames may take."""
MAX_SAMPLE_EDGE_PX = 1000
"""Longest edge of a reduced frame, which bounds the time."""


class FrameSample:
    """Frames of one size, reduced; the mask is estimated at that size and enlarged."""

    def __init__(self, height: int, width: int, expected: int) -> None:
        """Plan for frames of `height` x `width` pixels, about `expected` of them."""
        self._shape = height, width
        budget = MAX_SAMPLE_BYTES / max(expected, 1)
        self._scale = min(1.0, MAX_SAMPLE_EDGE_PX / max(height, width), float(np.sqrt(budget / (height * width))))
        self._frames: list[np.ndarray] = []

    @property
    def count(self) -> int:
        """Number of the frames so far."""
        return len(self._frames)

    @property
    def is_full(self) -> bool:
        """Whether the frames take twice the bytes that were planned."""
        return sum(frame.nbytes for frame in self._frames[:1]) * self.count > 2 * MAX_SAMPLE_BYTES

    def halve(self) -> None:
        """Keep every second frame, from the first on."""
        self._frames = self._frames[::2]

    def add(self, frame: np.ndarray) -> None:
        """Add a frame (H, W) uint8 or uint16."""
        if self._scale < 1.0:
            size = max(1, round(frame.shape[1] * self._scale)), max(1, round(frame.shape[0] * self._scale))
            frame = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
        self._frames.append((frame >> 8).astype(np.uint8) if frame.dtype == np.uint16 else frame.copy())

    def estimate_mask(self, spheres: Sequence[Sphere], within: np.ndarray | None = None) -> np.ndarray:
        """Estimate the mask (H, W) bool in full size; empty if no connected area flashes.

        spheres: in pixels of the full size. within: (H, W) bool, where the object lies; None: anywhere.

        Raises:
            UnusableCapture: no pixel shows a highlight, or nearly all do.
        """
        scale = self._scale
        reduced = [
            Sphere((sphere.x + 0.5) * scale - 0.5, (sphere.y + 0.5) * scale - 0.5, sphere.radius * scale)
            for sphere in spheres
        ]
        frames = np.stack(self._frames)
        if within is not None and scale < 1.0:
            within = cv2.resize(within.astype(np.uint8), frames.shape[:0:-1], interpolation=cv2.INTER_NEAREST) > 0
        mask = estimate_mask(frames, spheres=reduced, within=within)
        if scale == 1.0:
            return mask
        enlarged = cv2.resize(mask.astype(np.float32), self._shape[::-1], interpolation=cv2.INTER_LINEAR)
        return np.asarray(cv2.GaussianBlur(enlarged, (0, 0), 0.5 / scale) > 0.5)
