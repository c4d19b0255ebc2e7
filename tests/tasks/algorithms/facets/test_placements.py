"""Placements of faceted bodies that follow from a silhouette."""

import numpy as np
import pytest

from glint.tasks.algorithms.facets.placements import Placement, placements_about_axis, placements_of_ends
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from tests.tasks.algorithms.facets.bottle import BODY, render_bottle
from tests.tasks.algorithms.prisms.block import INVERSE_FOCAL, Block


def difference(placement: Placement, block: Block) -> tuple[float, float, float]:
    """Degrees by which the image of the axis, its tilt, and the turn of the polygon are wrong."""
    angle = (float(np.degrees(placement.angle)) + 180.0) % 360.0 - 180.0
    tilt, turn = float(np.degrees(placement.tilt)), float(np.degrees(placement.polygon.turn))
    if abs(angle) > 90.0:
        # The same axis, told downwards.
        angle, tilt, turn = 180.0 - abs(angle), -tilt, -turn
    period = 360.0 / placement.polygon.sides
    around = (turn - block.turns[0] + period / 2.0) % period - period / 2.0
    return abs(angle), abs(tilt - block.slope), abs(around)


@pytest.mark.parametrize(
    "block",
    [
        Block(),
        Block(lean=12.0, turns=(8.0, 68.0, 128.0, 188.0, 248.0, 308.0)),
        Block(lean=12.0, turns=(24.0, 84.0, 144.0, 204.0, 264.0, 324.0)),
        Block(lean=-10.0, half_height=40.0),
        Block(slope=28.0, lean=14.0, turns=(10.0, 82.0, 154.0, 226.0, 298.0)),
        Block(slope=40.0, lean=8.0, turns=(30.0, 120.0, 210.0, 300.0), radius=45.0),
    ],
    ids=["prism", "frustum", "one corner missing", "turned over", "pentagon", "square"],
)
def test_the_contour_of_two_ends_gives_axis_tilt_and_turn(block: Block) -> None:
    mask = np.isfinite(block.render(rounding=0.5)[1])
    sides = len(block.turns)
    found = [placement for placement in placements_of_ends(mask) if placement.polygon.sides == sides]
    nearest = min(sum(difference(placement, block)) for placement in found)
    assert nearest < 3.0


def test_a_near_camera_sees_nearly_the_same_ends() -> None:
    block = Block(lean=12.0, inverse_focal=INVERSE_FOCAL)
    mask = np.isfinite(block.render(rounding=0.5)[1])
    found = [placement for placement in placements_of_ends(mask, INVERSE_FOCAL) if placement.polygon.sides == 6]
    assert min(sum(difference(placement, block)) for placement in found) < 12.0


def test_a_round_silhouette_has_no_ends() -> None:
    right, down = np.meshgrid(np.arange(170) - 84.5, np.arange(190) - 94.5)
    assert placements_of_ends(right**2 + down**2 < 70.0**2) == []


def test_a_flat_face_gives_the_turn_of_what_is_tried_about_an_axis() -> None:
    mask = np.isfinite(render_bottle()[1])
    side = BODY.normals[2]
    without, tried = placements_about_axis(mask, []), placements_about_axis(mask, [side])
    nearest = [
        min(sum(difference(placement, BODY)) for placement in placements if placement.polygon.sides == 6)
        for placements in (without, tried)
    ]
    assert nearest[1] < 6.0 < nearest[0]


def test_nothing_is_tried_about_no_axis() -> None:
    right, down = np.meshgrid(np.arange(80), np.arange(80))
    assert placements_about_axis((right < 60) & (down < 60) & (right + 2 * down > 70), []) == []


def test_neighbours_lie_to_either_side() -> None:
    placement = Placement(0.1, 2.0, 0.5, RoundedPolygon(6, 0.2))
    neighbours = list(placement.beside(0.01, 0.5, 0.02, 0.1))
    assert len(neighbours) == 8
    assert {round(near.angle - 0.1, 6) for near in neighbours} == {-0.01, 0.0, 0.01}
    assert {round(near.offset - 2.0, 6) for near in neighbours} == {-0.5, 0.0, 0.5}
    assert {round(near.polygon.turn - 0.2, 4) for near in neighbours} == {-0.1047, 0.0, 0.1047}
    assert all(placement.is_near(near) for near in neighbours)
    # A turn by a whole side is none, half a side is another body.
    assert placement.is_near(Placement(0.1, 2.0, 0.5, RoundedPolygon(6, 0.2 + np.pi / 3.0)))
    assert not placement.is_near(Placement(0.1, 2.0, 0.5, RoundedPolygon(6, 0.2 + np.pi / 6.0)))
    assert not placement.is_near(Placement(0.1, 2.0, 0.5, RoundedPolygon(5, 0.2)))
    assert not placement.is_near(Placement(0.1, 2.0, 0.5 + np.radians(11.0), RoundedPolygon(6, 0.2)))
    assert not placement.is_near(Placement(0.1 + np.radians(1.1), 2.0, 0.5, RoundedPolygon(6, 0.2)))


def test_a_coarser_image_has_the_same_axis_in_its_own_pixels() -> None:
    placement = Placement(0.3, 20.0, 0.5, RoundedPolygon(6, 0.2))
    middle = np.array([3.0, -4.0])
    frame = placement.frame(1.0 / 450.0, middle, 2)
    assert (2.0 * frame.point + middle) @ placement.axis.normal == pytest.approx(20.0)
    assert frame.inverse_focal == 1.0 / 450.0


def test_the_end_of_a_body_gives_its_polygon_no_turn() -> None:
    mask = np.isfinite(render_bottle()[1])
    without, tried = (
        [placement.tilt for placement in placements_about_axis(mask, faces)] for faces in ([], [BODY.normals[0]])
    )
    unchanged = np.degrees([tilt for tilt in set(without) if tried.count(tilt) == without.count(tilt)])
    # About axes within 26 degrees of its normal the face is an end, about others it would be a side.
    assert len(unchanged) > 3 and np.abs(np.abs(unchanged) - BODY.slope).max() < 26.0
    assert len(np.unique(np.sign(unchanged))) == 1
