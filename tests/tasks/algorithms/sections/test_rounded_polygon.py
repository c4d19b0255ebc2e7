"""Rounded polygons about an axis."""

import numpy as np
import pytest

from glint.tasks.algorithms.prisms.rounded_contour import distances_from_polygon
from glint.tasks.algorithms.sections.rounded_polygon import CIRCLE, RoundedPolygon


def test_a_polygon_touches_the_circle_of_its_apothem_and_that_of_its_corners() -> None:
    square = RoundedPolygon(4, np.radians(30.0))
    assert np.allclose((square.corners @ square.outward.T).max(axis=1), 1.0)
    assert np.allclose(np.linalg.norm(square.corners, axis=1), square.circumradius)
    # Each corner comes after the side of the same number.
    assert np.allclose((square.corners * square.outward).sum(axis=1), 1.0)


def test_a_polygon_ends_edge_on_at_the_side_that_faces_away_most() -> None:
    tilts = np.array([0.3, -0.3])
    # A triangle with a side towards the camera; the others face away by 60 degrees.
    towards, away = (RoundedPolygon(3, turn).edge_on_tilts(tilts) for turn in (0.0, np.pi))
    assert np.allclose(np.tan(towards), np.tan(tilts) / [0.5, 1.0])
    assert np.allclose(np.tan(away), np.tan(tilts) / [1.0, 0.5])
    assert np.allclose(RoundedPolygon(4, 0.0).edge_on_tilts(tilts), tilts)


SECTIONS = [
    RoundedPolygon(4, 0.3, 0.4),
    RoundedPolygon(4, 1.2, 0.3, 0.6),
    RoundedPolygon(4, 0.0, 0.5, 1.7),
    RoundedPolygon(3, 0.2, 0.5),
    RoundedPolygon(6, 0.1, 0.2),
]


def boundary(section: RoundedPolygon, apothem: float) -> np.ndarray:
    """Points (N, 2) as far from an inner polygon as its corners are rounded."""
    inner = RoundedPolygon(
        section.sides, section.turn, 0.0, (section.width - section.rounding) / (1.0 - section.rounding)
    )
    # Counter-clockwise, as the distance wants it.
    corners = np.ascontiguousarray(apothem * (1.0 - section.rounding) * inner.corners[::-1])
    points = []
    for azimuth in np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False):
        near, far = 0.0, 10.0 * apothem
        for _ in range(60):
            middle = (near + far) / 2.0
            point = middle * np.array([[np.sin(azimuth), np.cos(azimuth)]])
            is_inside = distances_from_polygon(point, corners)[0] <= apothem * section.rounding
            near, far = (middle, far) if is_inside else (near, middle)
        points.append(point[0])
    return np.array(points)


@pytest.mark.parametrize("section", SECTIONS)
def test_the_apothem_is_that_of_the_boundary_through_a_point(section: RoundedPolygon) -> None:
    for apothem in (1.0, 7.0):
        points = boundary(section, apothem)
        assert np.allclose(section.apothems(points), apothem, atol=1e-9)
        assert np.linalg.norm(points, axis=1).max() < section.circumradius * apothem + 1e-9
        for direction in ([1.0, 0.0], [0.0, -1.0], [0.6, 0.8]):
            reach = apothem * section.reach(np.array(direction))
            assert reach - 0.02 * apothem < (points @ direction).max() < reach + 1e-9


@pytest.mark.parametrize("section", SECTIONS)
def test_the_gradient_is_that_of_the_apothem(section: RoundedPolygon) -> None:
    points, step = boundary(section, 5.0), 1e-6
    for axis, shift in enumerate(step * np.eye(2)):
        slopes = (section.apothems(points + shift) - section.apothems(points - shift)) / (2.0 * step)
        assert np.abs(section.gradients(points)[:, axis] - slopes).max() < 1e-5


def test_a_square_that_is_rounded_in_full_is_a_circle() -> None:
    points = np.random.default_rng(0).normal(size=(50, 2))
    nearly = RoundedPolygon(4, 0.7, 1.0 - 1e-9)
    assert CIRCLE.is_circle
    assert not nearly.is_circle
    assert np.allclose(CIRCLE.apothems(points), np.linalg.norm(points, axis=1))
    assert np.allclose(nearly.apothems(points), CIRCLE.apothems(points))
    assert np.allclose(CIRCLE.gradients(points), points / np.linalg.norm(points, axis=1)[:, None])


def test_a_rounded_polygon_ends_edge_on_where_its_apothem_changes_most() -> None:
    tilts = np.array([0.3, -0.3])
    # A corner towards the camera; an arc of a square with sides at 45 degrees is the steepest there.
    sharp, rounded = (RoundedPolygon(4, np.pi / 4.0, rounding).edge_on_tilts(tilts) for rounding in (0.0, 0.5))
    assert np.allclose(np.tan(sharp), np.tan(tilts) * np.sqrt(2.0))
    assert np.allclose(np.tan(rounded), np.tan(tilts) * (0.5 * np.sqrt(2.0) + 0.5))
    assert np.allclose(CIRCLE.edge_on_tilts(tilts), tilts)
    assert np.allclose(np.tan(RoundedPolygon(4, np.pi / 2.0, 0.1, 2.0).edge_on_tilts(tilts)), np.tan(tilts) * 2.0)
