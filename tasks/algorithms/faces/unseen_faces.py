"""Faces that never showed the light: their normals from the creases around them.

Such a face is slanted beyond the observable 45 degrees, and perpendicular to each of its creases: a crease lies in the
observed face on its other side, which gives its direction in space. Two creases of different directions give the
normal. With a single one the remaining angle is open: the mean and the spread of all normals that agree are returned,
weighted by the area that they show to the camera and by the smooth field.
"""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.faces.creases import UNSEEN, Edge, ObservedFaces, image_points
from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.distance import depth_inside
from glint.tasks.algorithms.geometry.vectors import angles, unit

GRID_STEP = 0.02
"""Spacing of the normals that are compared, in n_x and n_y: uniform in the area that they show to the camera."""
CREASE_DEG = 3.0
"""Standard deviation of a crease's direction, by its edge in the picture and the normal of the observed face."""
FIELD_DEG = 25.0
"""Standard deviation of the smooth field where a face never showed the light."""
FLASHING_DEG, OBSERVED_LOG_PENALTY = 43.0, 3.0
"""Angle from the view vector up to which a face should have shown the light, and nats against one that did not."""
CONCAVE_LOG_PENALTY = 2.3
"""Nats against a face that turns towards the observed one: solids are mostly convex."""
JOINT_INRADII = 0.3
"""Distance in inradii of two edges' ends from one corner, since corners are rounded."""
MAX_CORNER_DEG = 165.0
"""Largest angle of one face's corner; if the part without a face is wider, it holds at least two faces."""
MAX_OVERHANG, MIN_OVERHANG_INRADII = 0.4, 0.1
"""Reach of a face beyond the ends of its edge: per pixel of distance from it, and at least, in inradii."""
MIN_PART_SHARE, MIN_PART_INRADII = 0.01, 0.08
"""Size of the smallest part without a face, as a share of the mask, and its inradius in the mask's."""
MAX_ACCEPTED_SHARE = 0.25
"""Share of accepted normals in the window around a pixel above which the pixel counts as observed."""
ACCEPTED_WINDOW_INRADII, MIN_ACCEPTED_WINDOW_PX = 0.06, 2
"""Half the side of this window in inradii, and at least, in pixels."""
BORDERED_SHARES, BORDERED_PLACES = (0.2, 0.8), 13
"""Part of an edge, as shares of the way along it, that a part without a face must border, and the places looked at."""
BORDERED_INRADII, MIN_BORDERED_PX = 0.3, 4
"""Distance in inradii up to which that part may begin, behind the rounding of the edge, and at least, in pixels."""
MIN_BORDERED_SHARE = 0.6
"""Share of these places behind which that part must lie."""


@dataclass(frozen=True, slots=True)
class UnseenFace:
    """A face without observation: pixels (H, W) bool, unit normal (3,), its standard deviation per axis in radians."""

    pixels: np.ndarray
    normal: np.ndarray
    spread: float


def unseen_faces(
    observed: ObservedFaces, known: np.ndarray, field: np.ndarray, mask: np.ndarray, inradius: float
) -> list[UnseenFace]:
    """Estimate the faces behind the edges of observed ones.

    Args:
        observed: the observed faces and their edges.
        known: (H, W) bool, pixels with an accepted normal.
        field: (H, W, 3), the smooth normal field, finite in the mask.
        mask: (H, W) bool.
        inradius: of the mask, in pixels.
    """
    unseen = mask & ~_observed_pixels(observed.faces, known, inradius)
    open_edges = [edge for edge in observed.edges if edge.behind == UNSEEN and _borders(edge, unseen, inradius)]
    groups = _corners(open_edges, inradius)
    # What is nearest to an edge at the silhouette lies behind that one, and nothing is known of it.
    nearest = _nearest_group([*groups, [edge for edge in observed.edges if edge not in open_edges]], unseen)
    inside = depth_inside(mask)
    result = []
    for number, group in enumerate(groups):
        pixels = largest_part((nearest == number) & _behind_edges(group, unseen, inradius))
        depth = depth_inside(pixels).max()
        if pixels.sum() >= MIN_PART_SHARE * mask.sum() and depth >= MIN_PART_INRADII * inradius:
            face = _estimate(group, observed.faces, field, pixels)
            flat = inside > 1.0 + observed.rounding * (1.0 - float(np.hypot(*face.normal[:2])))
            result.append(replace(face, pixels=pixels & flat & ~_rounded(group, observed, face)))
    return result


def _observed_pixels(faces: list[Face], known: np.ndarray, inradius: float) -> np.ndarray:
    """Return the pixels (H, W) bool of observed faces, and those among many accepted ones (H, W) bool."""
    # A few accepted pixels do not make a part observed: what lies in the middle of many does.
    density = ndimage.uniform_filter(
        known.astype(float), 2 * max(MIN_ACCEPTED_WINDOW_PX, round(ACCEPTED_WINDOW_INRADII * inradius)) + 1
    )
    return np.any([face.hull for face in faces], axis=0) | (density > MAX_ACCEPTED_SHARE)


def _behind_edges(group: list[Edge], unseen: np.ndarray, inradius: float) -> np.ndarray:
    """Return the pixels (H, W) bool of `unseen` that lie behind an edge of a group, and not far beside its ends."""
    points = image_points(unseen)
    behind = np.zeros(len(points), bool)
    for edge in group:
        height = (points - edge.start) @ edge.outward
        along = (points - edge.start) @ unit(edge.end - edge.start)
        overhang = np.maximum(-along, along - edge.length)
        behind |= (height > 0) & (overhang < np.maximum(MAX_OVERHANG * height, MIN_OVERHANG_INRADII * inradius))
    result = np.zeros(unseen.shape, bool)
    result[unseen] = behind
    return result


def _rounded(group: list[Edge], observed: ObservedFaces, face: UnseenFace) -> np.ndarray:
    """Return the pixels (H, W) bool of a face that belong to its rounded edges: there n_x, n_y are linear across."""
    points = image_points(face.pixels)
    rounded = np.zeros(len(points), bool)
    for edge in group:
        width = observed.rounding * abs(float((face.normal - observed.faces[edge.face].normal)[:2] @ edge.outward))
        rounded |= _distance(points, edge) < width
    result = np.zeros(face.pixels.shape, bool)
    result[face.pixels] = rounded
    return result


def _borders(edge: Edge, pixels: np.ndarray, inradius: float) -> bool:
    """Return whether a part (H, W) bool without a face lies along most of an edge, behind its rounding."""
    distances = np.arange(1, max(MIN_BORDERED_PX, round(BORDERED_INRADII * inradius)))
    rows, columns = edge.strip(np.linspace(*BORDERED_SHARES, BORDERED_PLACES), distances)
    inside = np.clip(rows, 0, pixels.shape[0] - 1), np.clip(columns, 0, pixels.shape[1] - 1)
    return bool(pixels[inside].any(axis=1).mean() > MIN_BORDERED_SHARE)


def _corners(edges: list[Edge], inradius: float) -> list[list[Edge]]:
    """Group edges that bound one and the same face: those of two faces that meet in a corner of less than 180 deg."""
    groups = [[edge] for edge in edges]
    for first in range(len(edges)):
        for second in range(first):
            if edges[first].face == edges[second].face or not _is_corner(edges[first], edges[second], inradius):
                continue
            pair = [group for group in groups if edges[first] in group or edges[second] in group]
            if len(pair) == 2:
                groups = [*(group for group in groups if group not in pair), pair[0] + pair[1]]
    return groups


def _is_corner(first: Edge, second: Edge, inradius: float) -> bool:
    """Return whether two edges meet in a corner whose outer angle one face can fill."""
    ends = [(np.linalg.norm(p - q), p, q) for p in (first.start, first.end) for q in (second.start, second.end)]
    distance, p, q = min(ends, key=lambda end: end[0])
    if distance > JOINT_INRADII * inradius:
        return False
    directions = [unit(edge.start + edge.end - 2.0 * end) for edge, end in ((first, p), (second, q))]
    angle = _turn(directions[0], directions[1], first.outward)
    return angle < MAX_CORNER_DEG and abs(angle - _turn(directions[1], directions[0], second.outward)) < 1e-6


def _turn(start: np.ndarray, end: np.ndarray, side: np.ndarray) -> float:
    """Return the angle in degrees, 0 to 360, from one direction (2,) to another, turning as from start to `side`."""
    sign = 1.0 if start[0] * side[1] - start[1] * side[0] > 0 else -1.0
    return float(np.degrees(sign * np.arctan2(start[0] * end[1] - start[1] * end[0], start @ end)) % 360.0)


def _nearest_group(groups: list[list[Edge]], pixels: np.ndarray) -> np.ndarray:
    """Return the number of the group (H, W) whose edges are nearest, -1 outside the pixels (H, W)."""
    points = image_points(pixels)
    result = np.full(pixels.shape, -1)
    if groups:
        far = np.full(len(points), np.inf)
        distance = [reduce(np.minimum, (_distance(points, edge) for edge in group), far) for group in groups]
        result[pixels] = np.argmin(distance, axis=0)
    return result


def _distance(points: np.ndarray, edge: Edge) -> np.ndarray:
    """Return the distances (N,) of points (N, 2) from an edge."""
    along = edge.end - edge.start
    share = np.clip((points - edge.start) @ along / (along @ along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - edge.start - share[:, None] * along, axis=1))


def _estimate(group: list[Edge], faces: list[Face], field: np.ndarray, pixels: np.ndarray) -> UnseenFace:
    """Return the face behind a group of edges: the mean of all normals, weighted by their posterior probability."""
    grid = np.arange(-1.0, 1.0, GRID_STEP) + GRID_STEP / 2.0
    x, y = (axis.ravel() for axis in np.meshgrid(grid, grid))
    x, y = x[x**2 + y**2 < 0.999], y[x**2 + y**2 < 0.999]
    normals = np.column_stack([x, y, np.sqrt(1.0 - x**2 - y**2)])
    mean_field = unit(field[pixels].mean(axis=0))
    log_posterior = -(angles(normals, mean_field) ** 2) / (2.0 * FIELD_DEG**2)
    log_posterior -= OBSERVED_LOG_PENALTY * (normals[:, 2] > np.cos(np.radians(FLASHING_DEG)))
    for edge in group:
        normal = faces[edge.face].normal
        slope = np.degrees(np.arcsin(np.clip(normals @ edge.direction(normal), -1.0, 1.0)))
        log_posterior -= slope**2 / (2.0 * CREASE_DEG**2)
        log_posterior -= CONCAVE_LOG_PENALTY * ((normals - normal)[:, :2] @ edge.outward < 0)
    weight = np.exp(log_posterior - log_posterior.max())
    weight /= weight.sum()
    mean = unit(weight @ normals)
    spread = np.sqrt(float(weight @ np.radians(angles(normals, mean)) ** 2) / 2.0)
    return UnseenFace(pixels, mean, spread)
