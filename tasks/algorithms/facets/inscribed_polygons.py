"""Largest regular polygons about an axis whose images lie inside a contour."""

from dataclasses import dataclass
from itertools import groupby

import cv2
import numpy as np
from numba import njit
from scipy import ndimage

from glint.tasks.algorithms.revolution.inscribed_circles import contour_crossings, lines_across_planes
from glint.tasks.algorithms.revolution.profile import CONE_SLOPE_RATIO, MIN_TAN_TILT
from glint.tasks.algorithms.revolution.view_rays import AxisRays

PROFILE_PX, PROFILE_SHARE = 0.6, 0.02
"""Deviation in pixels, and as a share of the largest apothem, up to which a part of a profile is straight."""
MIN_APOTHEM_PX, MIN_APOTHEM_SHARE = 2.0, 0.06
"""Apothem in pixels, and as a share of the largest, below which a profile ends."""
EDGE_ON_PX = 1.0
"""Half the height in pixels of a polygon's image below which it is a line."""
FALLING, RISING = -1, 1
"""Kinds of parts of a profile that the camera sees edge-on."""


@dataclass(frozen=True, slots=True)
class RegularPolygon:
    """Regular polygon about an axis, as large as its apothem, the distance of its sides, says.

    sides: their number. turn: azimuth of one of them about the axis, radians; 0 faces the camera.
    """

    sides: int
    turn: float

    @property
    def outward(self) -> np.ndarray:
        """Unit normals (sides, 2) of the sides, across and forward in the frame of the axis."""
        azimuths = self.turn + 2.0 * np.pi * np.arange(self.sides) / self.sides
        return np.column_stack([np.sin(azimuths), np.cos(azimuths)])

    @property
    def circumradius(self) -> float:
        """Distance of the corners from the axis, for an apothem of 1."""
        return float(1.0 / np.cos(np.pi / self.sides))

    @property
    def corners(self) -> np.ndarray:
        """Corners (sides, 2) for an apothem of 1, each after the side of the same number."""
        return self.circumradius * RegularPolygon(self.sides, self.turn + np.pi / self.sides).outward

    def edge_on_tilts(self, tilts: np.ndarray) -> np.ndarray:
        """Return the tilts (N,) at which a circle's cone is seen edge-on as the polygon's is at these, radians.

        Beside a sharp edge of the body, of polygons that are shifted towards one another, that one ends at its side
        which faces away most.
        """
        forward = self.outward[:, 1]
        side = np.where(tilts >= 0.0, -forward.min(), forward.max())
        return np.asarray(np.arctan(np.tan(tilts) / side))


def inscribed_polygons(contour: AxisRays, polygon: RegularPolygon, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (N,), equidistant by `step`, and the apothems (N,) of the largest polygons inside a contour.

    contour: rays through the points of a closed contour, in order, dense against the polygons.
    """
    heights, starts, slopes = lines_across_planes(contour, step)
    outward = polygon.outward
    apothems = _least_apothems(heights, starts @ outward.T, slopes @ outward.T)
    # A polygon that is seen nearly edge-on passes between two points of the contour.
    heights_met, sides_met = contour_crossings(contour, heights, step)
    # Beyond the body's ends rays meet planes far away, so its own width tells how high the image is.
    depth = float(np.abs(sides_met).max(initial=0.0)) * float(np.abs(contour.directions[:, 2]).max())
    if depth < EDGE_ON_PX:
        # The corners at both sides are seen where the contour crosses the height.
        left, right = -1.0 / polygon.corners[:, 0].min(), 1.0 / polygon.corners[:, 0].max()
    else:
        left, right = -outward[:, 0].min(), outward[:, 0].max()
    np.minimum.at(apothems, heights_met, np.maximum(-sides_met * left, sides_met * right))
    return heights, apothems


def straight_profile(heights: np.ndarray, apothems: np.ndarray, tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and apothems (M,) of the corners of a profile, upward, from and to the axis.

    Beside a sharp edge the contour is that of the edge, and the polygons form a pyramid that the camera sees edge-on:
    there the body ends in a flat face, or that leads to what stands on it.

    heights, apothems: (N,), equidistant samples, as of `inscribed_polygons`. tilts: (N,) of the axis at which circles
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


@njit(cache=True, nogil=True)
def _least_apothems(heights: np.ndarray, starts: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the apothem (N,) of the smallest polygon at each height that one of the lines meets.

    starts, slopes: (M, S), of the lines: distances along the normals of the polygon's sides at the height 0, and their
    change with the height.
    """
    least = np.empty(len(heights))
    for sample in range(len(heights)):
        smallest, height = np.inf, heights[sample]
        for line in range(len(starts)):
            apothem = -np.inf
            for side in range(starts.shape[1]):
                apothem = max(apothem, starts[line, side] + height * slopes[line, side])
            smallest = min(smallest, apothem)
        least[sample] = smallest
    return least
