"""Profiles of straight parts, from the largest polygons about an axis whose images lie inside a contour."""

from itertools import groupby

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.revolution.inscribed_sections import MIN_APOTHEM_PX
from glint.tasks.algorithms.revolution.profile import CONE_SLOPE_RATIO, MIN_TAN_TILT

PROFILE_PX, PROFILE_SHARE = 0.6, 0.02
"""Deviation in pixels, and as a share of the largest apothem, up to which a part of a profile is straight."""
MIN_APOTHEM_SHARE = 0.06
"""Apothem as a share of the largest below which a profile ends."""
FALLING, RISING = -1, 1
"""Kinds of parts of a profile that the camera sees edge-on."""


def straight_profile(heights: np.ndarray, apothems: np.ndarray, tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and apothems (M,) of the corners of a profile, upward, from and to the axis.

    Beside a sharp edge the contour is that of the edge, and the polygons form a pyramid that the camera sees edge-on:
    there the body ends in a flat face, or that leads to what stands on it.

    heights, apothems: (N,), equidistant samples, as of `inscribed_sections`. tilts: (N,) of the axis at which circles
    of these radii would be seen edge-on, radians.
    """
    largest = float(apothems.max())
    # Beyond its ends the polygons would lie outside the contour.
    parts, _ = ndimage.label(apothems >= max(MIN_APOTHEM_PX, MIN_APOTHEM_SHARE * largest))
    body = parts == parts[apothems.argmax()]
    line = np.column_stack([heights, apothems])[body].astype(np.float32)[:, None]
    tolerance = max(PROFILE_PX, PROFILE_SHARE * largest)
    corners = cv2.approxPolyDP(line, tolerance, closed=False)[:, 0].astype(float)
    if len(corners) < 2:
        return heights[:1], np.zeros(1)
    slopes = np.diff(corners[:, 1]) / np.diff(corners[:, 0])
    middles = (corners[1:, 0] + corners[:-1, 0]) / 2.0
    steepest = CONE_SLOPE_RATIO / np.maximum(np.abs(np.tan(np.interp(middles, heights, tilts))), MIN_TAN_TILT)
    kinds = np.where(slopes < -steepest, FALLING, np.where(slopes > steepest, RISING, 0))
    points = [(0.0, 0.0)]
    for kind, group in groupby(range(len(kinds)), lambda part: int(kinds[part])):
        start, *following = group
        run = corners[start : start + len(following) + 2]
        if kind in (FALLING, RISING):
            # A flat face lies where the pyramid is wider.
            run = run[[0, -1]]
            run[:, 0] = run[0 if kind == FALLING else -1, 0]
        points += [(float(height), float(apothem)) for height, apothem in run]
    points[0] = (points[1][0], 0.0)
    result = np.array([point for number, point in enumerate(points) if number == 0 or point != points[number - 1]])
    result = np.vstack([result, [result[-1, 0], 0.0]])
    return result[:, 0], result[:, 1]
