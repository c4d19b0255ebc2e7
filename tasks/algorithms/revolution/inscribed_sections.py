"""Largest circles, or other sections, about an axis whose images lie inside a contour."""

import numpy as np
from numba import njit
from scipy import ndimage

from glint.tasks.algorithms.revolution.view_rays import AxisRays
from glint.tasks.algorithms.sections.rounded_polygon import CIRCLE, RoundedPolygon, apothem_at

MIN_SIN_TILT = 0.005
"""Lower bound of the sine of the angle between a ray and the planes of the circles."""
MIN_COS_TILT = 0.2
"""Lower bound of its cosine: circles are not looked for along an axis that points to the camera."""

MIN_APOTHEM_PX = 2.0
"""Apothem below which a body that is not round ends."""
EDGE_ON_PX = 1.0
"""Half the height in pixels of a section's image below which it is a line."""


def inscribed_sections(
    contour: AxisRays, step: float, section: RoundedPolygon = CIRCLE
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (N,), equidistant by `step`, and apothems (N,) of the largest sections inside a closed contour.

    contour: rays through its points, in order, dense against the sections. section: a circle, whose apothem is its
    radius, or another one.
    """
    heights, starts, slopes = lines_across_planes(contour, step)
    heights_met, sides_met = contour_crossings(contour, heights, step)
    # A section inside the contour is smaller than the one through the point at which each ray meets its plane. One that
    # is seen nearly edge-on passes between two points of the contour.
    if section.is_circle:
        squared = _least_squared_distances(heights, starts, slopes)
        np.minimum.at(squared, heights_met, sides_met**2)
        return heights, np.sqrt(squared)
    apothems = _least_apothems(heights, starts, slopes, section.circumradius, *section.shape)
    # Beyond the body's ends rays meet planes far away, so its own width tells how high the image is.
    depth = float(np.abs(sides_met).max(initial=0.0)) * float(np.abs(contour.directions[:, 2]).max())
    if depth < EDGE_ON_PX:
        # Its farthest points to both sides are seen where the contour crosses the height.
        left, right = section.reach(np.array([-1.0, 0.0])), section.reach(np.array([1.0, 0.0]))
        met = np.maximum(-sides_met / left, sides_met / right)
    else:
        met = section.apothems(np.column_stack([sides_met, np.zeros(len(sides_met))]))
    np.minimum.at(apothems, heights_met, met)
    # Beyond both ends they grow again, outside of the contour: the body is the longest part.
    parts, count = ndimage.label(apothems >= MIN_APOTHEM_PX)
    apothems[parts != 1 + np.bincount(parts, minlength=count + 2)[1:].argmax()] = 0.0
    return heights, apothems


def lines_across_planes(contour: AxisRays, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return heights (N,), equidistant by `step`, and where the rays of a closed contour meet the planes at these.

    Positions (M, 2) at the height 0, and their change (M, 2) with the height, across and forward.
    """
    _, ups = _middle_crossings(contour)
    heights = np.arange(ups.min(), ups.max() + step, step)
    rise = contour.directions[:, 2]
    rise = np.where(rise < 0.0, np.minimum(rise, -MIN_SIN_TILT), np.maximum(rise, MIN_SIN_TILT))
    slopes = contour.directions[:, :2] / rise[:, None]
    return heights, contour.origins[:, :2] - contour.origins[:, 2:] * slopes, slopes


def contour_crossings(contour: AxisRays, heights: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (L,) of the heights that a closed contour crosses, and its sides (L,) there, in pixels.

    contour: rays through its points, which cross the heights where they meet the plane through the axis that is
    parallel to the image's horizontal. heights: (N,), equidistant by `step`.
    """
    sides, ups = _middle_crossings(contour)
    return _crossings((ups - heights[0]) / step, sides, len(heights))


def _middle_crossings(contour: AxisRays) -> tuple[np.ndarray, np.ndarray]:
    """Return side and height (M,) where rays meet the plane through the axis parallel to the image's horizontal."""
    approach = np.maximum(contour.directions[:, 1], MIN_COS_TILT)
    sides, _, ups = contour.at(-contour.origins[:, 1] / approach).T
    return sides, ups


@njit(cache=True, nogil=True, fastmath={"nnan", "ninf", "nsz", "reassoc", "contract"})
def _least_squared_distances(heights: np.ndarray, starts: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the least squared distance (N,) from an axis of lines at each height (N,).

    starts, slopes: (M, 2), positions of the lines at the height 0, and their change with the height; all finite, which
    lets the compiler use vectors.
    """
    least = np.empty(len(heights))
    across, forward = starts[:, 0].copy(), starts[:, 1].copy()
    across_slope, forward_slope = slopes[:, 0].copy(), slopes[:, 1].copy()
    for sample in range(len(heights)):
        nearest, height = np.inf, heights[sample]
        for line in range(len(across)):
            side, front = across[line] + height * across_slope[line], forward[line] + height * forward_slope[line]
            nearest = min(nearest, side * side + front * front)
        least[sample] = nearest
    return least


@njit(cache=True, nogil=True)
def _least_apothems(
    heights: np.ndarray,
    starts: np.ndarray,
    slopes: np.ndarray,
    circumradius: float,
    sides: int,
    turn: float,
    rounding: float,
    width: float,
) -> np.ndarray:
    """Return the least apothem (N,) of the sections through lines at each height (N,).

    starts, slopes: (M, 2), see `_least_squared_distances`. circumradius and the others: of the section.
    """
    least = np.empty(len(heights))
    for sample in range(len(heights)):
        smallest, height = np.inf, heights[sample]
        for line in range(len(starts)):
            across, forward = starts[line, 0] + height * slopes[line, 0], starts[line, 1] + height * slopes[line, 1]
            # Beyond the circle about the smallest section no other one is smaller.
            if across * across + forward * forward < (circumradius * smallest) ** 2:
                smallest = min(smallest, apothem_at(across, forward, sides, turn, rounding, width)[0])
        least[sample] = smallest
    return least


def _crossings(position: np.ndarray, side: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples (N,), from 0 to length - 1, at which a closed polygon crosses them, and its sides (N,) there.

    Args:
        position: (M,), of the corners, along the axis, in samples.
        side: (M,), of the corners, perpendicular to it.
        length: number of samples.
    """
    following, next_side = np.roll(position, -1), np.roll(side, -1)
    first, last = np.ceil(np.minimum(position, following)), np.floor(np.maximum(position, following))
    numbers, sides = [], []
    for further in range(int((last - first).max()) + 1):
        number = first + further
        used = (number <= last) & (number >= 0) & (number < length) & (position != following)
        share = (number - position)[used] / (following - position)[used]
        numbers.append(number[used].astype(int))
        sides.append(side[used] + share * (next_side - side)[used])
    return np.concatenate(numbers), np.concatenate(sides)
