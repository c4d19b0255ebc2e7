"""View rays and surfaces of revolution: where a ray enters the body.

The distance from the axis is not monotonic along a ray, so the first sample inside brackets the surface, and that
bracket is halved.
"""

import numpy as np
from numba import njit

DEPTH_SAMPLES = 160
"""Samples along a ray among which the surface is bracketed."""
BISECTION_STEPS = 12
"""Halvings of that bracket."""


def entry_depths(
    side: np.ndarray, up: np.ndarray, tilt: float, heights: np.ndarray, squared_radii: np.ndarray, far: bool
) -> np.ndarray:
    """Return z (N,) in pixels of the first point inside the body along each ray, from the far end if `far`.

    NaN for rays that miss the body.

    Args:
        side: (N,), positions of the rays perpendicular to the axis, in the image.
        up: (N,), along it.
        tilt: of the axis' upper end towards the camera, radians.
        heights: (M,), samples along the axis, equidistant.
        squared_radii: (M,) there; 0 beyond the ends.
        far: whether to begin at the far end.
    """
    c, s = np.cos(tilt), np.sin(tilt)
    limit = float(np.sqrt(squared_radii.max()) * c + np.abs(heights).max() * abs(s)) + 1.0
    depths = np.linspace(limit, -limit, DEPTH_SAMPLES) * (-1.0 if far else 1.0)
    return np.asarray(_entry_depths(side, up, c, s, heights, squared_radii, depths))


@njit(cache=True, nogil=True)
def _entry_depths(
    side: np.ndarray,
    up: np.ndarray,
    c: float,
    s: float,
    heights: np.ndarray,
    squared_radii: np.ndarray,
    depths: np.ndarray,
) -> np.ndarray:
    """Return what `entry_depths` does; c, s: cosine and sine of the tilt; depths: samples of each ray."""
    result = np.full(len(side), np.nan)
    widest = squared_radii.max()
    for ray in range(len(side)):
        if side[ray] ** 2 >= widest:
            continue
        for sample in range(len(depths)):
            inside = depths[sample]
            if not _is_inside(inside, side[ray], up[ray], c, s, heights, squared_radii):
                continue
            outside = depths[max(sample - 1, 0)]
            for _ in range(BISECTION_STEPS):
                middle = (inside + outside) / 2
                if _is_inside(middle, side[ray], up[ray], c, s, heights, squared_radii):
                    inside = middle
                else:
                    outside = middle
            result[ray] = inside
            break
    return result


@njit(cache=True, nogil=True)
def _is_inside(
    depth: float, side: float, up: float, c: float, s: float, heights: np.ndarray, squared_radii: np.ndarray
) -> bool:
    """Return whether a point of a ray is nearer to the axis than the wall, whose squared radii are interpolated."""
    height, last = depth * s + up * c, len(heights) - 1
    if not heights[0] <= height <= heights[last]:
        return False
    place = (height - heights[0]) / (heights[1] - heights[0])
    below = min(int(place), last - 1)
    square = squared_radii[below] + (place - below) * (squared_radii[below + 1] - squared_radii[below])
    return bool(square > side**2 + (depth * c - up * s) ** 2)
