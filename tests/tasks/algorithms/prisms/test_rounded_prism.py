"""Surface of a prism with rounded edges, beside that of a box rendered from its distance function."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, positions_at
from glint.tasks.algorithms.prisms.right_prism import RightPrism, SweptContour
from glint.tasks.algorithms.prisms.rounded_contour import inset_polygon
from glint.tasks.algorithms.prisms.rounded_prism import RoundedPrism
from tests.tasks.algorithms.prisms.rounded_block import INVERSE_FOCAL, SHAPE, RoundedBlock


def solid_of(block: RoundedBlock) -> RoundedPrism:
    contour = SweptContour(*block.core.contour())
    return RoundedPrism(RightPrism(contour, float(np.radians(block.slope)), block.inverse_focal), block.radius)


@pytest.fixture(params=[0.0, INVERSE_FOCAL], ids=["parallel", "perspective"])
def block(request: pytest.FixtureRequest) -> RoundedBlock:
    return RoundedBlock(inverse_focal=request.param)


def positions(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.nonzero(mask)
    x, y = positions_at(rows.astype(float), columns.astype(float), SHAPE)
    return x, y


def test_normals_and_depths_are_those_of_the_box(block: RoundedBlock) -> None:
    truth, depths = block.render()
    mask = np.isfinite(depths)
    surface = solid_of(block).surface(*positions(mask))
    is_met = np.isfinite(surface.depths)
    assert is_met.mean() > 0.99
    error = angles(surface.normals, truth[mask])[is_met]
    # Under perspective the contour gives the size of a solid whose hidden end lies in the image plane.
    assert np.percentile(error, 50) < 0.1
    assert np.percentile(error, 95) < (6.0 if block.inverse_focal else 0.5)
    difference = (surface.depths - depths[mask])[is_met]
    # Depths are relative to the core's corner at the image plane; what counts is that all differ by the same.
    assert np.percentile(np.abs(difference - np.median(difference)), 95) < (4.0 if block.inverse_focal else 0.5)


def test_rays_beside_the_solid_meet_nothing(block: RoundedBlock) -> None:
    truth, _ = block.render()
    beside = np.isnan(truth[..., 0])
    beside[5:-5, 5:-5] = False
    surface = solid_of(block).surface(*positions(beside))
    assert np.isnan(surface.normals).all()
    assert np.isnan(surface.depths).all()


def test_edges_are_perpendicular_to_their_normals_and_faces_have_none(block: RoundedBlock) -> None:
    truth, depths = block.render()
    solid, mask = solid_of(block), np.isfinite(depths)
    surface = solid.surface(*positions(mask))
    faces = solid.flat_faces(surface.normals)
    has_edge = (surface.edges != 0.0).any(axis=1)
    is_flat = angles(surface.normals[:, None], solid.core.normals).min(axis=1) < 0.01
    assert has_edge[is_flat].mean() < 0.01
    assert (faces[is_flat] >= 0).all()
    assert has_edge[faces < 0].mean() > 0.6
    np.testing.assert_allclose(np.linalg.norm(surface.edges[has_edge], axis=1), 1.0)
    assert np.abs((surface.edges * surface.normals).sum(axis=1)[has_edge]).max() < 1e-9
    along = np.abs(surface.edges[has_edge] @ block.rotation)
    assert (along.max(axis=1) > 0.999).all()
    assert set(along.argmax(axis=1)) == {0, 1, 2}
    for number, normal in enumerate(solid.core.normals):
        assert (angles(truth[mask][faces == number], normal) < 1.5).mean() > 0.9


def test_a_sampled_image_shows_the_same_solid() -> None:
    block = RoundedBlock()
    truth, depths = block.render()
    solid = solid_of(block).seen_from(np.array([-0.5, 0.5]), 2)
    sampled = np.isfinite(depths)[::2, ::2]
    rows, columns = np.nonzero(sampled)
    surface = solid.surface(*positions_at(rows.astype(float), columns.astype(float), sampled.shape))
    is_met = np.isfinite(surface.depths)
    assert np.percentile(angles(surface.normals, truth[::2, ::2][sampled])[is_met], 95) < 1.0


def test_another_radius_keeps_the_straight_parts_of_the_contour() -> None:
    solid = solid_of(RoundedBlock())
    sharper = solid.with_radius(8.0)
    assert sharper is not None
    assert sharper.radius == 8.0
    corners = np.concatenate([sharper.core.contour.visible, sharper.core.contour.hidden])
    inset = inset_polygon(corners, solid.radius - 8.0)
    assert inset is not None
    np.testing.assert_allclose(inset, np.concatenate([solid.core.contour.visible, solid.core.contour.hidden]))
    assert solid.with_radius(60.0) is None
