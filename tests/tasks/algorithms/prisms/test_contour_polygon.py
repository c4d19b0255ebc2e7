"""Straight edges of convex silhouettes."""

import tracemalloc

import numpy as np
import pytest
from scipy.special import logsumexp

from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.prisms.contour_polygon import contour_polygons

SHAPE = (180, 200)


def inside(turns_deg: list[float], distances: list[float], rounding: float = 0.01) -> np.ndarray:
    """Mask of a convex polygon by the directions and distances of its edges, with rounded corners."""
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    turns = np.radians(turns_deg)[:, None, None]
    beyond = np.cos(turns) * x + np.sin(turns) * y - np.array(distances)[:, None, None]
    return np.asarray(rounding * logsumexp(beyond / rounding, axis=0) < 0.0)


TURNS, DISTANCES = [0.0, 65.0, 120.0, 180.0, 235.0, 310.0], [60.0, 55.0, 58.0, 62.0, 50.0, 57.0]


def true_corners() -> np.ndarray:
    corners = []
    for first, second, d, e in zip(TURNS, np.roll(TURNS, -1), DISTANCES, np.roll(DISTANCES, -1), strict=True):
        a, b = np.radians([first, second])
        edges = np.array([[np.cos(a), np.sin(a)], [np.cos(b), np.sin(b)]])
        corners.append(np.linalg.solve(edges, [d, e]))
    return np.array(corners)


@pytest.mark.parametrize(("rounding", "count"), [(0.1, 2), (3.0, 1)])
def test_corners_are_where_straight_edges_would_meet(rounding: float, count: int) -> None:
    # A polygon that follows rounded corners closely has more of them.
    hexagons = [corners for corners in contour_polygons(inside(TURNS, DISTANCES, rounding)) if len(corners) == 6]
    assert len(hexagons) == count
    for corners in hexagons:
        apart = np.linalg.norm(corners[:, None] - true_corners(), axis=-1)
        assert apart.min(axis=1).max() < 3.0
        x, y = corners.T
        assert x @ np.roll(y, -1) > y @ np.roll(x, -1)


def test_a_round_silhouette_has_none() -> None:
    rows, columns = np.indices(SHAPE).astype(float)
    assert contour_polygons(np.hypot(columns - 100.0, rows - 90.0) < 70.0) == []


@pytest.mark.parametrize(("count", "has_polygon"), [(4, False), (5, True), (10, True), (11, False)])
def test_five_to_ten_corners_are_those_of_a_solid_of_flat_faces(count: int, has_polygon: bool) -> None:
    turns = (360.0 / count * np.arange(count) + 7.0).tolist()
    polygons = contour_polygons(inside(turns, [65.0] * count, rounding=0.1))
    assert bool(polygons) == has_polygon and all(len(corners) == count for corners in polygons)


def test_a_silhouette_with_a_notch_has_none() -> None:
    mask = inside(TURNS, DISTANCES)
    mask[60:120, 100:] = False
    assert contour_polygons(mask) == []


def test_a_few_pixels_have_none() -> None:
    mask = np.zeros((20, 20), bool)
    mask[10, 10:12] = True
    assert contour_polygons(mask) == []


def test_long_edges_take_no_memory_with_the_square_of_their_length() -> None:
    columns, rows = np.meshgrid(np.arange(5000), np.arange(60))
    mask = (columns > 10) & (columns < 4990) & (rows > 10) & (rows < 50) & (columns + rows > 40)
    tracemalloc.start()
    polygons = contour_polygons(mask)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [len(corners) for corners in polygons] == [5, 5]
    # A square matrix of the points of one edge has 200 MB.
    assert peak < 5e7
