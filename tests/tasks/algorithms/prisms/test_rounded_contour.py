"""Convex contours whose corners are arcs."""

import numpy as np
import pytest

from glint.tasks.algorithms.prisms.rounded_contour import distances_from_polygon, inset_polygon, rounded_contours

SQUARE = np.array([[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]])
HEXAGON = 60.0 * np.array([[np.cos(turn), np.sin(turn)] for turn in 0.2 + np.pi / 3.0 * np.arange(6)])


def grown(corners: np.ndarray, radius: float) -> np.ndarray:
    """Draw a polygon (N, 2) that a disc has grown."""
    rows, columns = np.mgrid[:220, :220]
    points = np.column_stack([columns.ravel() - 109.5, 109.5 - rows.ravel()])
    return np.asarray((distances_from_polygon(points, corners) <= radius).reshape(220, 220))


def test_edges_are_moved_inwards_until_one_vanishes() -> None:
    inset = inset_polygon(SQUARE, 3.0)
    assert inset is not None
    np.testing.assert_allclose(inset, 0.7 * SQUARE)
    assert inset_polygon(SQUARE, 11.0) is None
    trapezium = np.array([[-10.0, 0.0], [10.0, 0.0], [2.0, 10.0], [-2.0, 10.0]])
    assert inset_polygon(trapezium, 4.5) is None


def test_distances_from_a_polygon() -> None:
    points = np.array([[0.0, 0.0], [13.0, 5.0], [13.0, 14.0], [10.0, 10.0]])
    np.testing.assert_allclose(distances_from_polygon(points, SQUARE), [0.0, 3.0, 5.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("radius", [4.0, 12.0, 25.0])
def test_the_radius_of_the_corners_is_measured(radius: float) -> None:
    contour, *_ = rounded_contours(grown(HEXAGON, radius))
    assert contour.radius == pytest.approx(radius, abs=2.0)
    assert len(contour.corners) == 6
    assert np.linalg.norm(contour.corners[:, None] - HEXAGON, axis=2).min(axis=1).max() < 3.0


def test_what_is_not_convex_has_no_rounded_polygon() -> None:
    bitten = grown(HEXAGON, 8.0)
    assert rounded_contours(bitten)
    bitten[100:120, 90:] = False
    assert rounded_contours(bitten) == []
