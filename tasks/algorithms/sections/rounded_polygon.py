"""Cross-sections of bodies about an axis: polygons whose corners are rounded; rounded in full, a square is a circle.

A body all of whose sections are one polygon, larger or smaller, is a straight homogeneous generalized cylinder (S. A.
Shafer, Shadows and Silhouettes in Computer Vision, 1985). The apothem of the polygon through a point takes the place
that the distance from the axis has in a surface of revolution.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True, slots=True)
class RoundedPolygon:
    """Polygon about an axis with rounded corners, as large as its apothem, the distance of its first side, says.

    sides: their number; the polygon is regular, or of four sides a rectangle. turn: azimuth of the first side about the
    axis, radians; 0 faces the camera. rounding: radius of the corners relative to the apothem. width: distance of a
    rectangle's second side, likewise, at least `rounding`.
    """

    sides: int
    turn: float
    rounding: float = 0.0
    width: float = 1.0

    @property
    def is_circle(self) -> bool:
        """Whether it is rounded in full."""
        return self.rounding >= 1.0

    @property
    def outward(self) -> np.ndarray:
        """Unit normals (sides, 2) of the sides, across and forward in the frame of the axis."""
        azimuths = self.turn + 2.0 * np.pi * np.arange(self.sides) / self.sides
        return np.column_stack([np.sin(azimuths), np.cos(azimuths)])

    @property
    def corners(self) -> np.ndarray:
        """Corners (sides, 2) for an apothem of 1, before they are rounded, each after the side of the same number."""
        return _corners(self.outward, self._distances)

    @property
    def circumradius(self) -> float:
        """Distance of its farthest points from the axis, for an apothem of 1."""
        return 1.0 if self.is_circle else float(np.linalg.norm(self._centres, axis=1).max()) + self.rounding

    def reach(self, direction: np.ndarray) -> float:
        """Return how far it reaches in a direction (2,), unit, for an apothem of 1."""
        return float((self._centres @ direction).max()) + self.rounding

    def apothems(self, points: np.ndarray) -> np.ndarray:
        """Return the apothems (N,) of the polygons through points (N, 2), across and forward from the axis."""
        if self.is_circle:
            return np.hypot(points[:, 0], points[:, 1])
        return np.asarray(_apothems(points, *self.shape))

    def gradients(self, points: np.ndarray) -> np.ndarray:
        """Return the gradients (N, 2) of `apothems`, perpendicular to the polygons through the points (N, 2)."""
        return np.asarray(_gradients(points, *self.shape))

    def edge_on_tilts(self, tilts: np.ndarray) -> np.ndarray:
        """Return the tilts (N,) at which a circle's cone is seen edge-on as the polygon's is at these, radians.

        Beside a sharp edge of the body, of polygons that are shifted towards one another, that one ends where it faces
        away most.
        """
        if self.is_circle:
            return tilts
        steepest = np.where(tilts >= 0.0, self._steepness(-1.0), self._steepness(1.0))
        return np.asarray(np.arctan(np.tan(tilts) / steepest))

    @property
    def shape(self) -> tuple[int, float, float, float]:
        """Its fields, as compiled functions take them."""
        return self.sides, self.turn, self.rounding, self.width

    @property
    def _distances(self) -> np.ndarray:
        """Distances (sides,) of the sides from the axis, for an apothem of 1."""
        return np.where(np.arange(self.sides) % 2 == 1, self.width, 1.0) if self.sides == 4 else np.ones(self.sides)

    @property
    def _centres(self) -> np.ndarray:
        """Centres (sides, 2) of the arcs that round its corners."""
        return _corners(self.outward, self._distances - self.rounding)

    def _steepness(self, forward: float) -> float:
        """Return the largest change of the apothem with a point that moves forward (1) or away (-1)."""
        flat = float((forward * self.outward[:, 1] / self._distances).max())
        return max(flat, 1.0 / self.reach(np.array([0.0, forward])))


CIRCLE = RoundedPolygon(4, 0.0, 1.0)
"""Section of a surface of revolution."""


def _corners(outward: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """Return the corners (N, 2) of a polygon whose sides have unit normals (N, 2), and distances (N,) from the axis."""
    pairs = np.stack([outward, np.roll(outward, -1, axis=0)], axis=1)
    return np.asarray(np.linalg.solve(pairs, np.column_stack([distances, np.roll(distances, -1)])[..., None])[..., 0])


@njit(cache=True, nogil=True)
def apothem_at(
    across: float, forward: float, sides: int, turn: float, rounding: float, width: float
) -> tuple[float, float, float]:
    """Return the apothem of the polygon through a point, and its gradient, across and forward.

    The others: fields of `RoundedPolygon`.
    """
    period = np.pi if sides == 4 else 2.0 * np.pi / sides
    azimuth = np.arctan2(across, forward) - turn
    side = turn + period * np.rint(azimuth / period)
    sine, cosine = np.sin(side), np.cos(side)
    out, aside = across * sine + forward * cosine, across * cosine - forward * sine
    sign = 1.0 if aside >= 0.0 else -1.0
    aside *= sign
    # Centre of the arc that rounds the next corner, for an apothem of 1.
    centre_out = 1.0 - rounding
    centre_aside = width - rounding if sides == 4 else centre_out * np.tan(period / 2.0)
    if aside < centre_aside * out:
        return out, sine, cosine
    if sides == 4 and width * out < centre_out * aside:
        return aside / width, sign * cosine / width, -sign * sine / width
    # The smaller root of the quadratic equation of an arc that grows as its centre moves out.
    square, along = out * out + aside * aside, out * centre_out + aside * centre_aside
    excess = centre_out * centre_out + centre_aside * centre_aside - rounding * rounding
    apothem = square / max(along + np.sqrt(max(along * along - excess * square, 0.0)), 1e-12)
    away_out, away_aside = out - apothem * centre_out, aside - apothem * centre_aside
    length = max(np.sqrt(away_out * away_out + away_aside * away_aside), 1e-12)
    scale = max(away_out * centre_out + away_aside * centre_aside + rounding * length, 1e-12)
    away_out, away_aside = away_out / scale, sign * away_aside / scale
    return apothem, away_out * sine + away_aside * cosine, away_out * cosine - away_aside * sine


@njit(cache=True, nogil=True)
def _apothems(points: np.ndarray, sides: int, turn: float, rounding: float, width: float) -> np.ndarray:
    result = np.empty(len(points))
    for number in range(len(points)):
        result[number] = apothem_at(points[number, 0], points[number, 1], sides, turn, rounding, width)[0]
    return result


@njit(cache=True, nogil=True)
def _gradients(points: np.ndarray, sides: int, turn: float, rounding: float, width: float) -> np.ndarray:
    result = np.empty((len(points), 2))
    for number in range(len(points)):
        _, across, forward = apothem_at(points[number, 0], points[number, 1], sides, turn, rounding, width)
        result[number, 0], result[number, 1] = across, forward
    return result
