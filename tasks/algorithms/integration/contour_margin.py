"""The margin of a depth map beside the occluding contour, where neither slopes nor heights can be observed.

There the normal turns perpendicular to the view within a pixel, so that slopes are unbounded, and heights depend on
which part of its outermost pixel the surface covers. At a distance d inside its contour a surface that curves away with
radius r has the slope sqrt(r / (2 d)), and lies sqrt(2 r d) above it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage
from scipy.special import ndtri

from glint.tasks.algorithms.geometry.distance import inradius_of

MIN_COSINE = 0.01
"""Lower bound of the cosine between normal and line of sight inside the margin: 100 pixels per pixel."""
CONTOUR_MARGIN_PX = 1.5
"""Distance to the contour up to which a pixel belongs to the margin: its neighbours may lie outside."""
CONTOUR_SMOOTHING_PX = 2.0
"""Standard deviation in pixels with which the mask is smoothed: it levels stairs of up to five pixels, and draws the
contour of a circle of 20 pixels inward by a tenth of a pixel."""
SAMPLED_PX = 3.0, 5.0
"""Distances to the contour at which heights are taken for the margin: the four pixels around the first one are inside
it."""

MIN_KNOWN_WEIGHT = 0.2
"""Weight of the known ones among the four pixels around a position, from which it counts as known."""


@dataclass(frozen=True, slots=True)
class Contour:
    """The contour of a mask at sub-pixel precision: the half level of the smoothed mask.

    distance: (H, W) float32, of pixel centres to it in pixels, positive inside; saturates at some 5 pixels. inward:
    (2, H, W) float32, unit direction down and right. The edge of the array is no contour.
    """

    distance: np.ndarray
    inward: np.ndarray


def contour_of(mask: np.ndarray) -> Contour:
    """Return the contour of a mask (H, W) bool."""
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), CONTOUR_SMOOTHING_PX, borderType=cv2.BORDER_REPLICATE)
    # A straight edge after smoothing is the integral of the Gaussian.
    distance = CONTOUR_SMOOTHING_PX * ndtri(np.clip(smooth, 0.01, 0.99))
    gradient = np.stack([cv2.Sobel(smooth, cv2.CV_32F, *axes, scale=0.125) for axes in ((0, 1), (1, 0))])
    return Contour(distance.astype(np.float32), gradient / np.maximum(np.hypot(*gradient), 1e-6))


def least_cosines(mask: np.ndarray) -> np.ndarray:
    """Return the least cosine between normal and line of sight that each pixel (H, W) of a mask can show.

    Outermost pixels have that of half a pixel inside the contour. Where steeper normals are given, as those of the
    contour itself are, the depth would run away.
    """
    # A crop may end at the contour, so that the array's edge counts as one.
    outermost = mask & (cv2.erode(np.pad(mask, 1).astype(np.uint8), np.ones((3, 3), np.uint8))[1:-1, 1:-1] == 0)
    return np.where(outermost, 1.0 / np.sqrt(1.0 + inradius_of(mask)), MIN_COSINE)


def contour_heights(height: np.ndarray, mask: np.ndarray, contour: Contour) -> tuple[np.ndarray, np.ndarray]:
    """Extrapolate heights (H, W) from inside the margin to the contour by the law h = c + a sqrt(d).

    Returns:
        c and a, (H, W) float64 each, at the margin's pixels, NaN elsewhere and where the mask is too narrow: the height
        of the contour next to the pixel in pixels, and the rise, at most that of the largest circle inside the mask.
    """
    margin = mask & (contour.distance < CONTOUR_MARGIN_PX)
    rows, columns = np.nonzero(margin)
    distance = contour.distance[rows, columns]
    known = np.where(mask & ~margin, height, np.nan)
    samples = []
    for sampled in SAMPLED_PX:
        step = (sampled - distance) * contour.inward[:, rows, columns]
        samples.append(_sampled(known, rows + step[0], columns + step[1]))
    first, second = (np.sqrt(sampled) for sampled in SAMPLED_PX)
    rise = np.clip((samples[1] - samples[0]) / (second - first), 0.0, np.sqrt(2.0 * inradius_of(mask)))
    level = np.full((2, *mask.shape), np.nan)
    level[:, rows, columns] = samples[0] - first * rise, rise
    return level[0], level[1]


def with_margin(height: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Extrapolate the margin of a height (H, W) from the heights inside it, see `contour_heights`.

    Returns:
        The height (H, W), and which of its pixels are extrapolated, (H, W) bool.
    """
    contour = contour_of(mask)
    level, rise = contour_heights(height, mask, contour)
    extrapolated = level + rise * np.sqrt(np.maximum(contour.distance, 0.0))
    replaced = np.isfinite(extrapolated)
    return np.where(replaced, extrapolated, height), replaced


def _sampled(image: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return an image (H, W) with NaN at positions (N,), bilinear among the known ones of the four pixels around."""
    weight, value = (
        ndimage.map_coordinates(part, (rows, columns), order=1)
        for part in (np.isfinite(image).astype(float), np.nan_to_num(image, nan=0.0))
    )
    return np.where(weight > MIN_KNOWN_WEIGHT, value / np.maximum(weight, MIN_KNOWN_WEIGHT), np.nan)
