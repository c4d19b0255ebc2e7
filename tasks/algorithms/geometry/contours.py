"""Contours of masks: their pixels, and lines to a fraction of a pixel."""

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import unit

CONTOUR_SIGMA_PX = 1.5
"""Standard deviation of the smoothing along the contour, against the staircase of pixels."""


def outermost_pixels(mask: np.ndarray, *, is_border_outside: bool = False) -> np.ndarray:
    """Return the pixels (H, W) bool of a mask (H, W) bool that share an edge with a pixel outside it.

    is_border_outside: whether what lies beyond the border of the image is outside; else the mask goes on there.
    """
    return mask & ~ndimage.binary_erosion(mask, border_value=not is_border_outside)


def smooth_contour(mask: np.ndarray) -> np.ndarray:
    """Return the longest outer contour (N, 2) of a mask (H, W) bool: column and row of the pixels' outer edge."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    pixels = max(contours, key=len)[:, 0].astype(float)
    smooth = ndimage.gaussian_filter1d(pixels, CONTOUR_SIGMA_PX, axis=0, mode="wrap")
    following, before = np.roll(smooth, -1, axis=0), np.roll(smooth, 1, axis=0)
    # At the tip of a line of single pixels the contour turns back, and has no direction.
    along = np.nan_to_num(unit(following - before))
    turns = np.sign((smooth[:, 0] * following[:, 1] - smooth[:, 1] * following[:, 0]).sum())
    outward = turns * np.column_stack([along[:, 1], -along[:, 0]])
    # The centres of the outermost pixels lie half a pixel, a row or a column, inside the edge.
    return np.asarray(smooth + 0.5 * np.abs(outward).max(axis=1, keepdims=True) * outward)
