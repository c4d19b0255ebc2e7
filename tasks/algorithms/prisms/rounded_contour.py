"""Convex contours whose corners are arcs of one radius: the outline of a polygon grown by a disc.

A solid with rounded edges is a smaller one grown by a ball, and so under parallel rays its silhouette is that of the
smaller solid grown by a disc of the same radius.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.prisms.contour_polygon import contour_polygons, convex_contour

RADII_INRADII = np.linspace(0.02, 0.5, 25)
"""Radii of the corners that are tried, in inradii of the silhouette; a solid with the largest is a pebble, no prism."""


class RoundedContour(NamedTuple):
    """Contour of a polygon that a disc has grown: corners (N, 2) of the polygon, and the disc's radius in pixels.

    Corners are counter-clockwise, x right and y up, pixels from the centre of the image.
    """

    corners: np.ndarray
    radius: float


def rounded_contours(mask: np.ndarray) -> list[RoundedContour]:
    """Return rounded polygons with the contour of a convex silhouette, mask (H, W) bool; see `contour_polygons`."""
    points, inradius = convex_contour(mask), inradius_of(mask)
    if points is None:
        return []
    fitted = (_fitted(corners, points, inradius) for corners in contour_polygons(mask))
    return [contour for contour in fitted if contour is not None]


def inset_polygon(corners: np.ndarray, distance: float) -> np.ndarray | None:
    """Return the corners (N, 2) of a convex polygon (N, 2), counter-clockwise, with edges moved inwards by a distance.

    None where an edge would vanish.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1, keepdims=True)
    places = (outward * corners).sum(axis=1) - distance
    pairs = np.stack([np.roll(outward, 1, axis=0), outward], axis=1)
    inset = np.linalg.solve(pairs, np.column_stack([np.roll(places, 1), places])[..., None])[..., 0]
    keeps_edges = ((np.roll(inset, -1, axis=0) - inset) * edges).sum(axis=1) > 0.0
    return inset if keeps_edges.all() else None


def _fitted(corners: np.ndarray, points: np.ndarray, inradius: float) -> RoundedContour | None:
    """Return the rounded polygon inside corners (N, 2) nearest to points (M, 2) of a contour; None: all too sharp."""
    best, least = None, np.inf
    for radius in RADII_INRADII * inradius:
        inset = inset_polygon(corners, radius)
        if inset is None:
            break
        error = float(((distances_from_polygon(points, inset) - radius) ** 2).mean())
        if error < least:
            best, least = RoundedContour(inset, float(radius)), error
    return None if best is None or best.radius >= RADII_INRADII[-1] * inradius else best


@njit(cache=True)
def distances_from_polygon(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the distances (M,) of points (M, 2) from a convex polygon (N, 2), counter-clockwise, 0 inside of it."""
    result = np.zeros(len(points))
    for number in range(len(points)):
        x, y, _ = from_polygon(points[number, 0], points[number, 1], corners)
        result[number] = np.sqrt(x * x + y * y)
    return result


@njit(cache=True)
def from_polygon(x: float, y: float, corners: np.ndarray) -> tuple[float, float, int]:
    """Return the vector to a point from the nearest point of a convex polygon (M, 2), and the side that holds this.

    The vector is 0 inside; the side is -1 where the nearest point is a corner.
    """
    best_x, best_y, best, side = 0.0, 0.0, np.inf, -1
    is_inside = True
    for number in range(len(corners)):
        following = (number + 1) % len(corners)
        edge_x, edge_y = corners[following, 0] - corners[number, 0], corners[following, 1] - corners[number, 1]
        from_x, from_y = x - corners[number, 0], y - corners[number, 1]
        if edge_x * from_y - edge_y * from_x < 0.0:
            is_inside = False
        share = (from_x * edge_x + from_y * edge_y) / (edge_x * edge_x + edge_y * edge_y)
        is_corner = share <= 0.0 or share >= 1.0
        share = min(max(share, 0.0), 1.0)
        rest_x, rest_y = from_x - share * edge_x, from_y - share * edge_y
        square = rest_x * rest_x + rest_y * rest_y
        if square < best:
            best_x, best_y, best, side = rest_x, rest_y, square, -1 if is_corner else number
    if is_inside:
        return 0.0, 0.0, 0
    return best_x, best_y, side
