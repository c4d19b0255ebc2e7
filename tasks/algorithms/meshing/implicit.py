"""Implicit solids: functions f(points (N, 3)) -> (N,), negative inside; primitives, blends, normals and their mesh.

Meshing is by surface nets: S. F. F. Gibson, Constrained Elastic Surface Nets, MICCAI 1998, with Newton steps onto the
surface in place of the elastic relaxation. A grid is made well-composed first (Latecki, 3D Well-Composed Pictures,
Graphical Models and Image Processing 1997), so that no edge has four triangles. The blend is the log-sum-exp (soft
minimum) of the solids.
"""

from collections.abc import Callable, Sequence

import numpy as np

from glint.tasks.algorithms.geometry.vectors import lengths

ImplicitFunction = Callable[[np.ndarray], np.ndarray]

_DIFFERENCE_STEP = 1e-3
"""Half width of the central differences, in the unit of the points."""
MAX_DIFFERENCE_SHARE = 0.01
"""Largest half width of them in cells of the net."""
_NEWTON_STEPS = 4
"""Steps that move a vertex of the net onto the surface."""


def gradient(function: ImplicitFunction, points: np.ndarray, difference: float = _DIFFERENCE_STEP) -> np.ndarray:
    """Return the gradients (N, 3) float64 at points (N, 3) by central differences over this length."""
    result = np.empty_like(points)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = difference
        result[:, axis] = (function(points + step) - function(points - step)) / (2.0 * difference)
    return result


def surface_normals(function: ImplicitFunction, points: np.ndarray) -> np.ndarray:
    """Return outward unit normals (N, 3) of the surface at the points nearest to points (N, 3) beside it."""
    slope = gradient(function, points)
    square = np.maximum((slope**2).sum(axis=1), 1e-12)
    # One Newton step onto the surface.
    slope = gradient(function, points - slope * (function(points) / square)[:, None])
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


def ellipsoid(centre: tuple[float, float, float], radii: tuple[float, float, float]) -> ImplicitFunction:
    """Return an axis-aligned ellipsoid; f approximates the signed distance."""
    c, r = np.array(centre, float), np.array(radii, float)

    def function(points: np.ndarray) -> np.ndarray:
        p = (points - c) / r
        first = lengths(p)
        second = np.maximum(lengths(p / r), 1e-9)
        return first * (first - 1.0) / second

    return function


def capsule(
    start: tuple[float, float, float], end: tuple[float, float, float], r0: float, r1: float
) -> ImplicitFunction:
    """Return a rod whose radius changes linearly from r0 at the start to r1 at the end; f approximates the distance."""
    a, axis = np.array(start, float), np.subtract(end, start).astype(float)

    def function(points: np.ndarray) -> np.ndarray:
        p = points - a
        s = np.clip(p @ axis / (axis @ axis), 0.0, 1.0)
        return lengths(p - s[:, None] * axis) - (r0 + (r1 - r0) * s)

    return function


def torus(radius: float, tube: float) -> ImplicitFunction:
    """Return a ring about the y axis: a tube of radius `tube` whose centre line has this radius; f is the distance."""

    def function(points: np.ndarray) -> np.ndarray:
        return np.asarray(np.hypot(np.hypot(points[:, 0], points[:, 2]) - radius, points[:, 1]) - tube)

    return function


def polyhedron(faces: list[tuple[float, ...]], rounding: float) -> ImplicitFunction:
    """Return a convex polyhedron of faces (n_x, n_y, n_z, distance), each a unit outward normal and a plane's distance.

    rounding: edges bend over a few times this length, in the unit of the points; f is at most the signed distance.
    """
    plane = np.array(faces, float)

    def function(points: np.ndarray) -> np.ndarray:
        values = plane[:, :3] @ points.T - plane[:, 3:]
        maximum = values.max(axis=0)
        return np.asarray(maximum + rounding * np.log(np.exp((values - maximum) / rounding).sum(axis=0)))

    return function


def revolved(profile: Sequence[tuple[float, float]], rounding: float) -> ImplicitFunction:
    """Return the solid of revolution about the y axis of a profile, grown by `rounding`, which rounds its convex edges.

    profile: (radius, height), from the axis at the bottom to the axis at the top, joined by straight lines; f is the
    signed distance to it where it does not cross itself.
    """
    start = np.array(profile, float)
    end = np.roll(start, -1, axis=0)  # closed along the axis, from which no point is nearer
    along = end - start
    square = np.maximum((along**2).sum(axis=1), 1e-12)

    def function(points: np.ndarray) -> np.ndarray:
        flat = np.column_stack([np.hypot(points[:, 0], points[:, 2]), points[:, 1]])
        distance, crossings = np.full(len(flat), np.inf), np.zeros(len(flat), int)
        for number in range(len(start)):
            offset = flat - start[number]
            share = np.clip(offset @ along[number] / square[number], 0.0, 1.0)
            if number < len(start) - 1:
                distance = np.minimum(distance, np.hypot(*(offset - share[:, None] * along[number]).T))
            # A point is inside where a line outward crosses the profile an odd number of times.
            spans = (start[number, 1] > flat[:, 1]) != (end[number, 1] > flat[:, 1])
            rise = along[number, 1] if along[number, 1] != 0.0 else 1.0
            crossings += spans & (flat[:, 0] < start[number, 0] + (offset[:, 1] / rise) * along[number, 0])
        return np.asarray(np.where(crossings % 2 == 1, -distance, distance) - rounding)

    return function


def union(functions: list[ImplicitFunction], blend: float) -> ImplicitFunction:
    """Return the smooth union of solids; `blend` is the radius, in the unit of the points, over which they merge."""

    def function(points: np.ndarray) -> np.ndarray:
        values = np.stack([f(points) for f in functions])
        minimum = values.min(axis=0)
        return minimum - blend * np.log(np.exp((minimum - values) / blend).sum(axis=0))

    return function


def surface_nets(
    function: ImplicitFunction, low: np.ndarray, high: np.ndarray, cell: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh f = 0 within a box by surface nets (Gibson 1998); what extends beyond the box is cut off.

    Args:
        function: the solid.
        low, high: (3,) corners of the box.
        cell: edge of the grid's cells, in the unit of the points.

    Returns:
        Vertices (V, 3) float64 and triangles (F, 3) int64 of a closed manifold mesh, wound outwards: a vertex in each
        cell that the surface crosses, a quadrilateral for each grid edge that it crosses.
    """
    axes = [np.arange(lo - 2 * cell, hi + 3 * cell, cell) for lo, hi in zip(low, high, strict=True)]
    inside = _well_composed(_grid_inside(function, axes))
    corners = _crossing_quads(inside).reshape(-1, 3)
    cells, index = np.unique(np.ravel_multi_index(tuple(corners.T), inside.shape), return_inverse=True)
    places = np.unravel_index(cells, inside.shape)
    vertices = np.stack([axis[place] for axis, place in zip(axes, places, strict=True)], axis=1) + cell / 2
    # Cells are far smaller than the usual difference where the unit of the points is large.
    difference = min(_DIFFERENCE_STEP, MAX_DIFFERENCE_SHARE * cell)
    # Newton steps along the gradient, each at most a cell long.
    for _ in range(_NEWTON_STEPS):
        slope = gradient(function, vertices, difference)
        step = slope * (function(vertices) / np.maximum((slope**2).sum(axis=1), 1e-9))[:, None]
        vertices -= np.clip(step, -cell, cell)
    square = index.reshape(-1, 4)
    return vertices, np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


def _grid_inside(function: ImplicitFunction, axes: list[np.ndarray]) -> np.ndarray:
    """Return which points of a grid (X, Y, Z) lie inside; its border never does, so that the mesh closes."""
    inside = np.empty(tuple(len(axis) for axis in axes), bool)
    # Plane by plane, since coordinates of the whole grid would take much memory.
    plane = np.stack(np.meshgrid(axes[1], axes[2], indexing="ij"), axis=-1).reshape(-1, 2)
    for i, x in enumerate(axes[0]):
        inside[i] = (function(np.column_stack([np.full(len(plane), x), plane])) < 0).reshape(inside.shape[1:])
    inside[[0, -1]] = inside[:, [0, -1]] = inside[:, :, [0, -1]] = False
    return inside


def _well_composed(inside: np.ndarray) -> np.ndarray:
    """Return the grid (X, Y, Z) bool with points added where parts of the solid meet in no more than an edge or corner.

    Nothing is added at its border, nor anywhere if the solid keeps away from itself.
    """
    while True:
        added = np.zeros_like(inside)
        for first, second in ((0, 1), (0, 2), (1, 2)):
            grid, change = (np.moveaxis(values, (first, second), (0, 1)) for values in (inside, added))
            a, b, c, d = grid[:-1, :-1], grid[1:, 1:], grid[1:, :-1], grid[:-1, 1:]
            change[1:, :-1] |= a & b & ~c & ~d
            change[:-1, :-1] |= c & d & ~a & ~b
        corners = [inside[_shifted(corner)] for corner in range(8)]
        count = np.sum(corners, axis=0, dtype=np.uint8)
        for corner in range(4):
            # Corners corner and 7 - corner are opposite; a neighbour of a corner differs in one bit.
            near, far = corners[corner], corners[7 - corner]
            added[_shifted(corner ^ 1)] |= (count == 2) & near & far
            added[_shifted(corner)] |= (count == 6) & ~near & ~far
        added &= ~inside
        if not added.any():
            return inside
        inside = inside | added


def _shifted(corner: int) -> tuple[slice, ...]:
    """Return the part of a grid that holds one corner of each of its cells: the bits 4, 2, 1 are x, y, z."""
    return tuple(slice(1, None) if corner & bit else slice(0, -1) for bit in (4, 2, 1))


def _crossing_quads(inside: np.ndarray) -> np.ndarray:
    """Return, for each grid edge that crosses the surface, the four cells (Q, 4, 3) around it, wound outwards."""
    quads = []
    for axis in range(3):
        along = np.moveaxis(inside, axis, 0)
        crossings = np.argwhere(along[:-1] != along[1:])
        grid = np.insert(crossings[:, 1:], axis, crossings[:, 0], axis=1)
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        quad = np.stack([grid - u - v, grid - v, grid, grid - u], axis=1)
        # Where the axis enters the solid instead of leaving it, the winding is reversed.
        leaves = inside[tuple(grid.T)]
        quad[~leaves] = quad[~leaves][:, ::-1]
        quads.append(quad)
    return np.concatenate(quads)
