"""Straight edges of a convex silhouette: the polygon that bounds it."""

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.vectors import to_camera

MIN_CONVEX_SHARE = 0.965
"""Least share of its convex hull that a silhouette must cover; masks are rough, and edges rounded."""
CHORD_INRADII, MIN_CHORD_PX = 0.1, 4
"""Half the length in inradii of the chords that show the contour's direction, and at least, in pixels."""
MAX_CURVATURE = 0.5
"""Curvature of a straight part, which pixels make rough, relative to that of a circle of the inradius."""
POLYGON_INRADII, MIN_POLYGON_PX = 0.04, 1.5
"""Deviation from the contour of a polygon that follows it, in inradii, and at least, in pixels."""
MIN_STRAIGHT_INRADII, MIN_SIDE_INRADII, MIN_SIDE_PX = 0.12, 0.15, 3
"""Lengths in inradii of the shortest straight part and the shortest side of that polygon, and at least, in pixels."""
STRAIGHT_SHARES = (0.12, 0.88)
"""Part of a side, as shares of the way along it, to which its line is fitted: ends are rounded corners."""
MIN_CORNER_TURN_DEG = 6.0
"""Angle between two edges below which they are one."""
MIN_CORNERS, MAX_CORNERS = 5, 10
"""Corners that a solid of flat faces shows at least, unless a single face hides all others, and at most: with more of
them a silhouette is round."""


def contour_polygons(mask: np.ndarray) -> list[np.ndarray]:
    """Return polygons round a convex silhouette, each by the corners (N, 2) where its straight edges would meet.

    A short edge is hard to tell from a rounded corner: one polygon has those that straight parts of the contour show,
    the other those of a polygon that follows it closely. None of them has too few or too many corners, and there is
    none round a silhouette that is not convex.

    mask: (H, W) bool. Corners are counter-clockwise, x right and y up, pixels from the centre of the image. Edges pass
    through the centres of the outermost pixels, half a pixel inside the silhouette: with edges along their outer sides
    prisms come out a little better, and frusta worse.
    """
    points = convex_contour(mask)
    if points is None:
        return []
    inradius = inradius_of(mask)
    polygons = [
        _corners(_lines(points, parts)) for parts in (_straight_parts(points, inradius), _sides(points, inradius))
    ]
    return [corners for corners in polygons if MIN_CORNERS <= len(corners) <= MAX_CORNERS]


def convex_contour(mask: np.ndarray) -> np.ndarray | None:
    """Return points (N, 2) a pixel apart on the convex hull of a silhouette (H, W) bool; None if it is not convex.

    They run counter-clockwise through the centres of the outermost pixels, x right and y up, from the image's centre.
    """
    contour = max(cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    hull = cv2.convexHull(contour)
    covered = np.zeros(mask.shape, np.uint8)
    cv2.fillConvexPoly(covered, hull, 1)
    if mask.sum() < MIN_CONVEX_SHARE * covered.sum():
        return None
    columns, rows = _dense(hull[:, 0].astype(float)).T
    x, y = to_camera(columns, rows, mask.shape[1], mask.shape[0])
    points = np.column_stack([x, y])
    return points[::-1] if x @ np.roll(y, -1) < y @ np.roll(x, -1) else points


def _dense(corners: np.ndarray) -> np.ndarray:
    """Return points (N, 2) a pixel apart on the closed polygon with these corners (M, 2)."""
    return np.concatenate(
        [
            start
            + np.linspace(0.0, 1.0, max(int(np.linalg.norm(end - start)), 1), endpoint=False)[:, None] * (end - start)
            for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True)
        ]
    )


def _straight_parts(points: np.ndarray, inradius: float) -> list[np.ndarray]:
    """Return the points' numbers (M,) of each part of a closed contour (N, 2) that is straight, in its order."""
    reach = max(MIN_CHORD_PX, round(CHORD_INRADII * inradius))
    chords = np.roll(points, -reach, axis=0) - np.roll(points, reach, axis=0)
    heading = np.arctan2(chords[:, 1], chords[:, 0])
    turn = np.roll(heading, -reach) - np.roll(heading, reach)
    curvature = ((turn + np.pi) % (2.0 * np.pi) - np.pi) / (2.0 * reach)
    is_straight = curvature * inradius < MAX_CURVATURE
    if is_straight.all():
        return []
    first = int(np.argmin(is_straight))
    parts, count = ndimage.label(np.roll(is_straight, -first))
    runs = [(np.flatnonzero(parts == part + 1) + first) % len(points) for part in range(count)]
    return [run for run in runs if len(run) >= max(MIN_STRAIGHT_INRADII * inradius, MIN_SIDE_PX)]


def _sides(points: np.ndarray, inradius: float) -> list[np.ndarray]:
    """Return the points' numbers (M,) along each side of a polygon that follows a closed contour (N, 2)."""
    tolerance = max(POLYGON_INRADII * inradius, MIN_POLYGON_PX)
    corners = cv2.approxPolyDP(points.astype(np.float32)[:, None], tolerance, closed=True)[:, 0]
    places = np.array([((points - corner) ** 2).sum(axis=1).argmin() for corner in corners])
    sides = []
    for start, end in zip(places, np.roll(places, -1), strict=True):
        length = (end - start) % len(points)
        if length >= max(MIN_SIDE_INRADII * inradius, MIN_SIDE_PX):
            first, last = (round(share * length) for share in STRAIGHT_SHARES)
            sides.append((start + np.arange(first, last + 1)) % len(points))
    return sides


def _lines(points: np.ndarray, parts: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return a point (2,) and the direction (2,) of the line through each part of a contour (N, 2)."""
    lines = []
    for part in parts:
        centre = points[part].mean(axis=0)
        direction = np.linalg.svd(points[part] - centre, full_matrices=False)[2][0]
        forward = direction @ (points[part[-1]] - points[part[0]])
        lines.append((centre, direction * (np.sign(forward) or 1.0)))
    return lines


def _corners(lines: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the corners (N, 2) where each line meets the one before it, unless both are one."""
    corners = []
    for number in range(len(lines)):
        (first, along), (second, across) = lines[number - 1], lines[number]
        directions = np.column_stack([along, -across])
        if abs(np.linalg.det(directions)) > np.sin(np.radians(MIN_CORNER_TURN_DEG)):
            corners.append(first + np.linalg.solve(directions, second - first)[0] * along)
    return np.array(corners)
