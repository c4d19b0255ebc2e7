"""Largest polygons inside a contour, and the straight profile of the body that they are sections of."""

import numpy as np
import pytest

from glint.tasks.algorithms.facets.facet_view import silhouette_contour
from glint.tasks.algorithms.facets.inscribed_polygons import RegularPolygon, inscribed_polygons, straight_profile
from glint.tasks.algorithms.facets.placements import Placement
from tests.tasks.algorithms.prisms.block import INVERSE_FOCAL, Block

HEXAGON = RegularPolygon(6, np.radians(20.0))


def test_a_polygon_touches_the_circle_of_its_apothem_and_that_of_its_corners() -> None:
    square = RegularPolygon(4, np.radians(30.0))
    assert np.allclose((square.corners @ square.outward.T).max(axis=1), 1.0)
    assert np.allclose(np.linalg.norm(square.corners, axis=1), square.circumradius)
    # Each corner comes after the side of the same number.
    assert np.allclose((square.corners * square.outward).sum(axis=1), 1.0)


@pytest.mark.parametrize("inverse_focal", [0.0, INVERSE_FOCAL])
@pytest.mark.parametrize("slope", [4.0, 35.0])
def test_polygons_inside_the_contour_of_a_block_are_its_sections(slope: float, inverse_focal: float) -> None:
    block = Block(slope=slope, inverse_focal=inverse_focal)
    _, depths, _ = block.render()
    mask = np.isfinite(depths)
    contour = silhouette_contour(mask)
    frame = Placement(0.0, 0.0, np.radians(slope), HEXAGON).frame(inverse_focal, np.zeros(2), 1)
    heights, apothems = inscribed_polygons(frame.rays(*contour.T), HEXAGON, 1.0)
    inside = np.abs(heights) < 0.8 * block.half_height
    assert np.abs(apothems[inside] - block.radius).max() < 1.5
    assert (apothems < block.radius + 1.5)[np.abs(heights) < block.half_height].all()


@pytest.mark.parametrize("slope", [0.1, 0.3, 0.8])
def test_of_polygons_seen_edge_on_the_corners_touch_the_contour(slope: float) -> None:
    block = Block(slope=slope)
    contour = silhouette_contour(np.isfinite(block.render()[1]))
    frame = Placement(0.0, 0.0, np.radians(slope), HEXAGON).frame(0.0, np.zeros(2), 1)
    heights, apothems = inscribed_polygons(frame.rays(*contour.T), HEXAGON, 1.0)
    inside = np.abs(heights) < 0.8 * block.half_height
    assert np.abs(apothems[inside] - block.radius).max() < 0.2


def test_a_polygon_ends_edge_on_at_the_side_that_faces_away_most() -> None:
    tilts = np.array([0.3, -0.3])
    # A triangle with a side towards the camera; the others face away by 60 degrees.
    towards, away = (RegularPolygon(3, turn).edge_on_tilts(tilts) for turn in (0.0, np.pi))
    assert np.allclose(np.tan(towards), np.tan(tilts) / [0.5, 1.0])
    assert np.allclose(np.tan(away), np.tan(tilts) / [1.0, 0.5])
    assert np.allclose(RegularPolygon(4, 0.0).edge_on_tilts(tilts), tilts)


def test_a_profile_ends_flat_where_its_sections_are_seen_edge_on() -> None:
    heights = np.arange(-40.0, 61.0)
    tilt = np.radians(30.0)
    # A wall, its end seen edge-on down to a neck, and the neck's end.
    falling = 1.0 / np.tan(tilt)
    apothems = np.minimum(30.0, np.maximum(30.0 - falling * (heights - 20.0), 8.0))
    apothems = np.minimum(apothems, np.maximum(8.0 - falling * (heights - 50.0), 0.0))
    at, sizes = straight_profile(heights, apothems, np.full(len(heights), tilt))
    assert sizes[0] == sizes[-1] == 0.0
    assert (np.diff(at) >= 0.0).all()
    for middle, size in ((-30.0, 30.0), (15.0, 30.0), (25.0, 8.0), (46.0, 8.0)):
        assert abs(np.interp(middle, at, sizes) - size) < 1.0
    # Flat: at its shoulder and at its end.
    flat = at[:-1][np.diff(at) == 0.0]
    assert {min((-40.0, 20.0, 50.0), key=lambda end: abs(end - height)) for height in flat} == {-40.0, 20.0, 50.0}
    assert all(min(abs(height - end) for end in (-40.0, 20.0, 50.0)) < 3.0 for height in flat)


def test_a_profile_without_sections_is_empty() -> None:
    heights = np.arange(5.0)
    corners = np.column_stack(straight_profile(heights, np.zeros(5), np.zeros(5)))
    assert (corners[:, 1] == 0.0).all()
