"""Image pyramid of the temporal median and maximum (Burt and Adelson 1983, with a box filter)."""

from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.lighting.circles import LogGradient, log_gradient

MIN_LEVEL_RADIUS_PX, MAX_LEVEL_RADIUS_PX = 18.0, 44.0
"""Radii searched on a pyramid level, in its pixels; larger spheres are found on coarser levels."""


@dataclass(frozen=True, slots=True)
class PyramidLevel:
    """Level of an image pyramid.

    median: temporal median (h, w) float32. residual: maximum - median, (h, w). edges: of median and maximum. scale:
    full-frame pixels per pixel.
    """

    median: np.ndarray
    residual: np.ndarray
    edges: list[LogGradient]
    scale: float

    def to_full_frame(self, x: float, y: float, radius: float) -> tuple[float, float, float]:
        """Return a circle (x, y, radius) of this level in full-frame pixels."""
        shift = 0.5 * (self.scale - 1.0)
        return x * self.scale + shift, y * self.scale + shift, radius * self.scale


def pyramid(median: np.ndarray, maximum: np.ndarray) -> list[PyramidLevel]:
    """Return levels of halved images (H, W), down to where a sphere of the frame's size has the largest radius."""
    levels, scale = [], 1
    while min(median.shape) / scale >= 2 * MIN_LEVEL_RADIUS_PX:
        levels.append(pyramid_level(median, maximum, scale))
        if min(median.shape) / scale < 2 * MAX_LEVEL_RADIUS_PX:
            break
        scale *= 2
    return levels


def pyramid_level(median: np.ndarray, maximum: np.ndarray, scale: int) -> PyramidLevel:
    """Return the level of temporal median and maximum (H, W) reduced `scale` times."""
    pair = [reduced_image(image, scale) for image in (median, maximum)]
    return PyramidLevel(pair[0], pair[1] - pair[0], [log_gradient(image) for image in pair], float(scale))


def reduced_image(image: np.ndarray, scale: int) -> np.ndarray:
    """Return an image (H, W) reduced `scale` times by averaging, (H // scale, W // scale) float32."""
    image = image.astype(np.float32)
    if scale == 1:
        return image
    height, width = (side // scale * scale for side in image.shape)
    return cv2.resize(image[:height, :width], (width // scale, height // scale), interpolation=cv2.INTER_AREA)
