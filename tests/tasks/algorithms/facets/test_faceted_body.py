"""Faceted bodies as the camera sees them: faces, their normals and depths, and creases."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.facets.facet_view import silhouette_contour
from glint.tasks.algorithms.facets.faceted_body import FacetedBody
from glint.tasks.algorithms.facets.placements import Placement
from glint.tasks.algorithms.geometry.perspective import to_camera_directions
from glint.tasks.algorithms.geometry.vectors import angles, to_camera
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from tests.tasks.algorithms.facets.bottle import BODY, NECK_RADIUS, NECK_TOP, render_bottle
from tests.tasks.algorithms.prisms.block import INVERSE_FOCAL, SHAPE, Block

FRUSTUM = Block(lean=12.0)


def body_of(mask: np.ndarray, slope: float, inverse_focal: float = 0.0) -> FacetedBody:
    placement = Placement(0.0, 0.0, float(np.radians(slope)), RoundedPolygon(6, float(np.radians(20.0))))
    frame = placement.frame(inverse_focal, np.zeros(2), 1)
    return FacetedBody.inside(silhouette_contour(mask), frame, placement.polygon)


def normals_shown(body: FacetedBody) -> np.ndarray:
    faces = body.faces(SHAPE)
    return np.where((faces >= 0)[..., None], body.normals[faces], np.nan)


@pytest.mark.parametrize("inverse_focal", [0.0, INVERSE_FOCAL])
def test_a_frustum_is_seen_as_it_is(inverse_focal: float) -> None:
    truth, depths, _ = Block(lean=12.0, inverse_focal=inverse_focal).render()
    mask = np.isfinite(depths)
    body = body_of(mask, FRUSTUM.slope, inverse_focal)
    error = angles(normals_shown(body), truth)[mask]
    assert np.nanmedian(error) < 1.5
    assert np.nanmean(error) < 5.0
    assert np.isnan(error).mean() < 0.03


def test_a_neck_stands_on_its_shoulder() -> None:
    truth, depths = render_bottle()
    mask = np.isfinite(depths)
    body = body_of(mask, BODY.slope)
    assert np.nanmean(angles(normals_shown(body), truth)[mask]) < 7.5
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    faces = body.faces(SHAPE)
    seen = mask & (faces >= 0)
    difference = body.depths(x[seen], y[seen], faces[seen]) - depths[seen]
    assert np.median(np.abs(difference - np.median(difference))) < 1.5


def test_a_neck_hides_the_shoulder_behind_it() -> None:
    neck = replace(BODY, radius=NECK_RADIUS, half_height=NECK_TOP, lean=0.0)
    front, upper = (np.nan_to_num(block.render()[1], nan=-np.inf) for block in (BODY, neck))
    truth, depths = render_bottle()
    error = angles(normals_shown(body_of(np.isfinite(depths), BODY.slope)), truth)
    assert np.nanmean(error[upper > front]) < 15.0


def test_depths_lie_in_the_planes_of_their_faces() -> None:
    body = body_of(np.isfinite(FRUSTUM.render()[1]), FRUSTUM.slope, INVERSE_FOCAL)
    assert len(body.normals) >= 3
    for number, (corners, normal) in enumerate(zip(body.corners, body.normals, strict=True)):
        x, y = corners.T
        z = body.depths(x, y, np.full(len(x), number))
        points = np.column_stack([x, y, np.zeros(len(x))]) + z[:, None] * to_camera_directions(x, y, INVERSE_FOCAL)
        assert np.ptp(points @ normal) < 1e-6


def test_creases_are_perpendicular_to_both_of_their_faces() -> None:
    body = body_of(np.isfinite(FRUSTUM.render()[1]), FRUSTUM.slope)
    creases = body.creases
    assert len(creases.faces) >= 5
    for end in (0, 1):
        assert np.abs((body.normals[creases.faces[:, end]] * creases.directions).sum(axis=1)).max() < 1e-6
    # In the image a crease runs as its direction does.
    along = creases.ends - creases.starts
    turned = along[:, 0] * creases.directions[:, 1] - along[:, 1] * creases.directions[:, 0]
    assert np.abs(turned).max() < 1e-6 * np.abs(along).max()
