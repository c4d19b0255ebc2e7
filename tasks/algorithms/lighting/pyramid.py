"""A few of a capture's frames, their image pyramid (Burt and Adelson 1983, with a box filter), and their logarithms."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from glint.tasks.algorithms.lighting.circles import LOG_OFFSET, LogGradient, log_gradient

MIN_LEVEL_RADIUS_PX, MAX_LEVEL_RADIUS_PX = 18.0, 44.0
"""Radii searched on a pyramid level, in its pixels; larger spheres are found on coarser levels."""
MAX_LEVEL_PIXELS = 2_600_000
"""Pixels of the finest level at most: in a larger frame a sphere has a larger radius."""
DISC_RADIUS_RATIO, CLOSING_PX = 0.45, 9
"""Least radius of a disc of highlights in radii of the sphere; gaps between highlights that are closed, in pixels."""
LIT_SHARE, BRIGHTEST_PERCENTILE = 0.5, 99.8
"""Share of the level of the brightest pixels above which the passing light lit a pixel, and their percentile."""
USUAL_PERCENTILE = 75.0
"""Percentile of a pixel's levels that a passing light exceeds, but not the table under a light that stays high."""
DEVIATION_LEVELS = 200.0
"""Levels that stand for a standard deviation of one in log levels."""
SMOOTHING_PX = 0.7
"""Standard deviation in pixels by which frames are smoothed before they are sampled."""


def spread(frames: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` of the frames (T, ...), spread evenly."""
    return frames[np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames))).round().astype(int))]


@dataclass(frozen=True, slots=True)
class PyramidLevel:
    """Level of an image pyramid.

    residual: (h, w), the temporal maximum above the usual level. edges: of temporal median, maximum and deviation.
    frames: of `log_frames`, (h, w) each. reduction: full-frame pixels per pixel.
    """

    residual: np.ndarray
    edges: list[LogGradient]
    frames: list[np.ndarray]
    reduction: float

    def to_full_frame(self, x: float, y: float, radius: float) -> tuple[float, float, float]:
        """Return a circle (x, y, radius) of this level in full-frame pixels."""
        shift = 0.5 * (self.reduction - 1.0)
        return x * self.reduction + shift, y * self.reduction + shift, radius * self.reduction

    def from_full_frame(self, x: float, y: float, radius: float) -> tuple[float, float, float]:
        """Return a circle (x, y, radius) of the full frame in this level's pixels."""
        shift = 0.5 * (self.reduction - 1.0)
        return (x - shift) / self.reduction, (y - shift) / self.reduction, radius / self.reduction

    def lit_discs(self) -> list[tuple[float, float, float]]:
        """Return the smallest circles (x, y, radius) around what the light lit: discs of highlights on spheres."""
        lit = self.residual > LIT_SHARE * np.percentile(self.residual, BRIGHTEST_PERCENTILE)
        closing = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSING_PX, CLOSING_PX))
        closed = cv2.morphologyEx(lit.astype(np.uint8), cv2.MORPH_CLOSE, closing)
        contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        circles = [cv2.minEnclosingCircle(contour) for contour in contours]
        least = DISC_RADIUS_RATIO * MIN_LEVEL_RADIUS_PX
        return [(x, y, radius) for (x, y), radius in circles if least <= radius <= MAX_LEVEL_RADIUS_PX]


def pyramid(frames: Sequence[np.ndarray] | np.ndarray, maximum: np.ndarray) -> Iterator[PyramidLevel]:
    """Yield levels of halved images (H, W), down to where a sphere of the frame's size has the largest radius."""
    reduction = 1
    while maximum.size > MAX_LEVEL_PIXELS * reduction**2:
        reduction *= 2
    while min(maximum.shape) / reduction >= 2 * MIN_LEVEL_RADIUS_PX:
        yield pyramid_level(frames, maximum, reduction)
        if min(maximum.shape) / reduction < 2 * MAX_LEVEL_RADIUS_PX:
            break
        reduction *= 2


def pyramid_level(frames: Sequence[np.ndarray] | np.ndarray, maximum: np.ndarray, reduction: int) -> PyramidLevel:
    """Return the level of frames and their temporal maximum, (H, W) each, reduced `reduction` times."""
    reduced = np.stack([reduced_image(frame, reduction) for frame in frames])
    peak = reduced_image(maximum, reduction).astype(np.float32)
    logs = log_frames(reduced)
    median, usual = _percentiles(reduced, np.array((50.0, USUAL_PERCENTILE)))
    deviation = DEVIATION_LEVELS * np.std(logs, axis=0)
    edges = [log_gradient(image) for image in (median, peak, deviation)]
    return PyramidLevel(np.maximum(peak - usual, 0.0), edges, logs, float(reduction))


@njit(cache=True, nogil=True)
def _percentiles(frames: np.ndarray, percentiles: np.ndarray) -> np.ndarray:
    """Return temporal percentiles (P, H, W) float32, interpolated linearly, of frames (T, H, W).

    Compiled: a dozen values of a pixel are sorted in place, where sorting along the first axis copies all of them.
    """
    count, height, width = frames.shape
    result = np.empty((percentiles.size, height, width), np.float32)
    values = np.empty(count, np.float32)
    for i in range(height):
        for j in range(width):
            for t in range(count):
                value, place = np.float32(frames[t, i, j]), t
                while place > 0 and values[place - 1] > value:
                    values[place] = values[place - 1]
                    place -= 1
                values[place] = value
            for p in range(percentiles.size):
                position = percentiles[p] / 100.0 * (count - 1)
                lower = min(int(position), count - 1)
                upper = min(lower + 1, count - 1)
                result[p, i, j] = values[lower] + (position - lower) * (values[upper] - values[lower])
    return result


def log_frames(frames: Sequence[np.ndarray] | np.ndarray) -> list[np.ndarray]:
    """Return smoothed logarithms (H, W) float32 of frames (H, W) in levels of 8 bits."""
    return [cv2.GaussianBlur(_log_levels(frame), (0, 0), SMOOTHING_PX) for frame in frames]


def _log_levels(frame: np.ndarray) -> np.ndarray:
    """Return the logarithms (H, W) float32 of a frame (H, W); those of whole levels are looked up."""
    if frame.dtype == np.uint8:
        return np.asarray(cv2.LUT(frame, np.log(np.arange(256, dtype=np.float32) + np.float32(LOG_OFFSET))))
    return np.log(np.asarray(frame, np.float32) + np.float32(LOG_OFFSET))


def reduced_image(image: np.ndarray, reduction: int) -> np.ndarray:
    """Return an image (H, W) reduced so many times by averaging, (H // reduction, W // reduction) float32.

    As it is if the reduction is 1.
    """
    if reduction == 1:
        return image
    image = image.astype(np.float32)
    height, width = (side // reduction * reduction for side in image.shape)
    return cv2.resize(image[:height, :width], (width // reduction, height // reduction), interpolation=cv2.INTER_AREA)
