"""Solids as the zero set of a function f(points (N, 3)) -> (N,), negative inside: blends, normals and their mesh."""

from collections.abc import Callable

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]

_STEP = 1e-3


def gradient(field: Field, points: np.ndarray) -> np.ndarray:
    """Gradients (N, 3) by central differences in float64."""
    result = np.empty_like(points)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = _STEP
        result[:, axis] = (field(points + step) - field(points - step)) / (2.0 * _STEP)
    return result


def surface_normals(field: Field, points: np.ndarray) -> np.ndarray:
    """Outward unit normals (N, 3) at the feet on the surface of points (N, 3) near it."""
    slope = gradient(field, points)
    square = np.maximum((slope**2).sum(axis=1), 1e-12)
    slope = gradient(field, points - slope * (field(points) / square)[:, None])
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


def hit_along(field: Field, origins: np.ndarray, directions: np.ndarray, start: np.ndarray, most: float) -> np.ndarray:
    """Ray parameters (N,) where f = 0 near `start`, by Newton steps; NaN where they lead more than `most` away."""
    t = start.astype(np.float64)
    for _ in range(6):
        points = origins + directions * t[:, None]
        slope = (gradient(field, points) * directions).sum(axis=1)
        step = field(points) / np.where(np.abs(slope) < 1e-9, np.inf, slope)
        t = t - np.clip(step, -most, most)
    missed = (np.abs(t - start) > most) | (np.abs(field(origins + directions * t[:, None])) > 1e-4)
    return np.where(missed, np.nan, t)


def ellipsoid(centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Field:
    """An axis-aligned ellipsoid; f is about the distance."""
    c, r = np.array(centre, float), np.array(radii, float)

    def field(points: np.ndarray) -> np.ndarray:
        p = (points - c) / r
        first = np.linalg.norm(p, axis=1)
        second = np.maximum(np.linalg.norm(p / r, axis=1), 1e-9)
        return first * (first - 1.0) / second

    return field


def capsule(start: tuple[float, float, float], end: tuple[float, float, float], r0: float, r1: float) -> Field:
    """A rod from start to end, its radius changing linearly from r0 to r1; f is about the distance."""
    a, axis = np.array(start, float), np.subtract(end, start).astype(float)

    def field(points: np.ndarray) -> np.ndarray:
        p = points - a
        s = np.clip(p @ axis / (axis @ axis), 0.0, 1.0)
        return np.linalg.norm(p - s[:, None] * axis, axis=1) - (r0 + (r1 - r0) * s)

    return field


def union(fields: list[Field], blend: float) -> Field:
    """The union of solids, smooth over about `blend` where they meet."""

    def field(points: np.ndarray) -> np.ndarray:
        values = np.stack([f(points) for f in fields])
        least = values.min(axis=0)
        return least - blend * np.log(np.exp((least - values) / blend).sum(axis=0))

    return field


def without(solid: Field, removed: Field, blend: float) -> Field:
    """The first solid less the second, smooth over about `blend` along the edge."""

    def field(points: np.ndarray) -> np.ndarray:
        a, b = solid(points), -removed(points)
        return np.maximum(a, b) + blend * np.log1p(np.exp(-np.abs(a - b) / blend))

    return field


def mesh_of(field: Field, low: np.ndarray, high: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Closed triangle mesh of f = 0 within a box, by surface nets: vertices (V, 3), triangles (F, 3) wound outwards.

    One vertex in each cell of a grid that the surface crosses, drawn onto the surface by Newton steps along the
    gradient; one quadrilateral for each grid edge that it crosses. What runs out of the box is cut off.
    """
    axes = [np.arange(lo - 2 * cell, hi + 3 * cell, cell) for lo, hi in zip(low, high, strict=True)]
    shape = tuple(len(a) for a in axes)
    inside = np.empty(shape, bool)
    plane = np.stack(np.meshgrid(axes[1], axes[2], indexing="ij"), axis=-1).reshape(-1, 2)
    for i, x in enumerate(axes[0]):
        inside[i] = (field(np.column_stack([np.full(len(plane), x), plane])) < 0).reshape(shape[1:])
    inside[[0, -1]] = inside[:, [0, -1]] = inside[:, :, [0, -1]] = False
    quads = []
    for axis in range(3):
        first = np.moveaxis(inside, axis, 0)
        where = np.argwhere(first[:-1] != first[1:])
        grid = np.insert(where[:, 1:], axis, where[:, 0], axis=1)
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        quad = np.stack([grid - u - v, grid - v, grid, grid - u], axis=1)
        leaves = inside[tuple(grid.T)]
        quad[~leaves] = quad[~leaves][:, ::-1]
        quads.append(quad)
    corners = np.concatenate(quads).reshape(-1, 3)
    cells, index = np.unique(np.ravel_multi_index(tuple(corners.T), shape), return_inverse=True)
    vertices = np.stack([a[i] for a, i in zip(axes, np.unravel_index(cells, shape), strict=True)], axis=1) + cell / 2
    for _ in range(4):
        slope = gradient(field, vertices)
        step = slope * (field(vertices) / np.maximum((slope**2).sum(axis=1), 1e-9))[:, None]
        vertices -= np.clip(step, -cell, cell)
    square = index.reshape(-1, 4)
    return vertices, np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
