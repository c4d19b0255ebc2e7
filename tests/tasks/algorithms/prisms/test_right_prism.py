"""Geometry of a right prism: its faces follow from its contour and the slope of its axis."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, to_camera
from glint.tasks.algorithms.prisms.right_prism import RightPrism, SweptContour, swept_contours
from tests.tasks.algorithms.prisms.block import INVERSE_FOCAL, Block


def prism_of(block: Block) -> RightPrism:
    return RightPrism(SweptContour(*block.contour()), float(np.radians(block.slope)), block.inverse_focal)


@pytest.fixture(params=[0.0, INVERSE_FOCAL], ids=["parallel", "perspective"])
def block(request: pytest.FixtureRequest) -> Block:
    return Block(inverse_focal=request.param)


def test_all_visible_faces_follow_from_contour_and_slope(block: Block) -> None:
    prism = prism_of(block)
    visible = [0, *sorted(set(np.unique(block.render()[2])) - {-1, 0})]
    assert len(prism.normals) == len(visible) == 4
    for normal in block.normals[visible]:
        assert min(angles(prism.normals, normal)) < 1.0


def test_each_face_is_where_it_is_seen(block: Block) -> None:
    truth, depths, _ = block.render(rounding=0.01)
    prism, mask = prism_of(block), np.isfinite(depths)
    faces = prism.faces(block.shape)
    assert ((faces >= 0) == mask).mean() > 0.985
    both = (faces >= 0) & mask
    assert (angles(prism.normals[faces[both]], truth[both]) < 1.5).mean() > 0.98


def test_depths_are_those_of_its_planes(block: Block) -> None:
    _, depths, _ = block.render(rounding=0.01)
    prism = prism_of(block)
    faces = prism.faces(block.shape)
    both = (faces >= 0) & np.isfinite(depths)
    rows, columns = np.nonzero(both)
    x, y = to_camera(columns.astype(float), rows.astype(float), block.shape[1], block.shape[0])
    difference = prism.depths(x, y, faces[both]) - depths[both]
    assert np.percentile(np.abs(difference - np.median(difference)), 95) < 2.0


def test_creases_lie_in_both_of_their_faces(block: Block) -> None:
    prism = prism_of(block)
    assert len(prism.creases) == 5
    for crease in prism.creases:
        assert np.abs(prism.normals[list(crease.faces)] @ crease.direction).max() < 1e-9


def test_the_contour_can_be_swept_as_it_is(block: Block) -> None:
    visible, hidden = block.contour()
    corners = np.concatenate([visible, hidden])
    found = [
        contour
        for contour in swept_contours(corners, block.inverse_focal)
        if len(contour.visible) == len(visible) and np.allclose(contour.visible, visible)
    ]
    assert len(found) == 1
    assert np.allclose(found[0].hidden, hidden)


def test_a_contour_without_parallel_edges_is_that_of_no_prism() -> None:
    corners = np.array([[50.0, 0.0], [20.0, 47.0], [-35.0, 40.0], [-48.0, -12.0], [5.0, -50.0]])
    assert swept_contours(corners) == []


@pytest.mark.parametrize(("shorter", "is_prism"), [(0.5, True), (0.4, False)])
def test_edges_along_the_axis_are_of_similar_length(shorter: float, is_prism: bool) -> None:
    # Two vertical edges, of which one is shorter than the other, and a corner above and below.
    corners = np.array([(-40.0, -50.0), (0.0, -75.0), (40.0, -50.0 * shorter), (40.0, 50.0 * shorter), (-40.0, 50.0)])
    found = swept_contours(corners)
    assert any(len(contour.visible) + len(contour.hidden) == 5 for contour in found) == is_prism


def test_an_image_of_every_other_pixel_shows_the_same_prism(block: Block) -> None:
    prism = prism_of(block)
    middle = np.array([-0.5, 0.5])
    smaller = prism.seen_from(middle, 2)
    assert np.abs(smaller.normals - prism.normals).max() < 0.01
    small, large = smaller.faces((95, 85)), prism.faces(block.shape)[::2, ::2]
    assert (small == large).mean() > 0.98


def test_an_edge_that_looks_too_long_does_not_move_the_end() -> None:
    block = Block()
    visible, hidden = block.contour()
    longer = visible.copy()
    longer[0] += np.array([0.0, 12.0])
    prism = RightPrism(SweptContour(longer, hidden), float(np.radians(block.slope)))
    crease = next(crease for crease in prism.creases if crease.faces == (0, 2))
    true = next(crease for crease in prism_of(block).creases if crease.faces == (0, 2))
    assert np.abs(crease.start - true.start).max() < 0.5
