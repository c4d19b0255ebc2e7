"""Flat faces that candidates prove, among others that are seen through them."""

import numpy as np
import pytest

from glint.tasks.algorithms.faces.proven_faces import PROVEN_NATS, face_evidence, proven_faces
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from tests.tasks.algorithms.faces.polyhedron import PYRAMID, SHAPE, face_numbers, polyhedron_normals
from tests.tasks.algorithms.revolution.beaker import observable

BEHIND = unit(np.array([[0.1, -0.2, 1.0], [-0.15, 0.3, 1.0]]))
"""Normals (2, 3) of faces that are seen through another one."""


def seen_through(truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return candidates (2, H, W, 3) in either order, and the mask: the first face shows two others behind it."""
    columns = np.indices(SHAPE)[1]
    is_first = face_numbers(PYRAMID) == 0
    false = np.where(is_first[..., None], np.where((columns > 105)[..., None], *BEHIND), np.nan)
    layers = np.stack([false, observable(truth)])
    swap = np.random.default_rng(0).random(SHAPE) < 0.5
    return np.where(swap[None, ..., None], layers[::-1], layers), np.isfinite(truth[..., 0])


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return polyhedron_normals(PYRAMID, rounding=1.5)


def test_faces_are_proven_and_those_behind_them_are_not(truth: np.ndarray) -> None:
    candidates, mask = seen_through(truth)
    faces = proven_faces(candidates, mask, inradius_of(mask))
    assert len(faces) == 2
    for normal in PYRAMID[:2]:
        assert min(float(angles(face.normal, normal)) for face in faces) < 1.0


def test_their_candidates_count_and_all_others_within_them_do_not(truth: np.ndarray) -> None:
    candidates, mask = seen_through(truth)
    evidence = face_evidence(candidates, mask, inradius_of(mask))
    inner = (angles(truth, PYRAMID[0]) < 1.0) & np.isfinite(candidates[..., 0]).all(axis=0)
    inner &= (evidence != 0.0).any(axis=0)
    assert inner.sum() > 300
    is_true = angles(candidates, truth[None]) < 1.0
    assert (evidence[:, inner] == np.where(is_true[:, inner], PROVEN_NATS, -PROVEN_NATS)).all()
    assert not evidence[:, face_numbers(PYRAMID) == 2].any()


def test_a_face_with_sharp_edges_is_not_proven() -> None:
    sharp = polyhedron_normals(PYRAMID, rounding=0.02)
    mask = np.isfinite(sharp[..., 0])
    assert proven_faces(observable(sharp)[None], mask, inradius_of(mask)) == []


def test_a_face_at_the_limit_of_the_lights_is_not_proven() -> None:
    slanted = unit(np.array([[0.7, 0.55, 1.0], [-0.6, 0.5, 1.0], [0.0, -1.3, 1.0]]))
    normals = polyhedron_normals(slanted, rounding=1.5)
    mask = np.isfinite(normals[..., 0])
    faces = proven_faces(observable(normals)[None], mask, inradius_of(mask))
    assert [float(angles(face.normal, slanted[1])) < 1.0 for face in faces] == [True]


def test_a_flat_sheet_in_a_sphere_is_not_proven() -> None:
    right, down = np.meshgrid(*(np.arange(size) - 79.5 for size in SHAPE))
    squared = (right**2 + down**2) / 70.0**2
    sphere = np.stack([right / 70.0, -down / 70.0, np.sqrt(np.maximum(1.0 - squared, 0.0))], axis=-1)
    mask = squared < 1.0
    false = np.where((np.hypot(right, down) < 30.0)[..., None], BEHIND[0], np.nan)
    candidates = np.stack([observable(np.where(mask[..., None], sphere, np.nan)), false])
    assert proven_faces(candidates, mask, inradius_of(mask)) == []


def test_without_candidates_nothing_is_proven() -> None:
    mask = np.ones((20, 30), bool)
    assert not face_evidence(np.full((2, 20, 30, 3), np.nan), mask, 10.0).any()


def test_a_near_camera_sees_the_same_faces(truth: np.ndarray) -> None:
    """A plane has one normal in the camera frame, and others relative to the rays."""
    camera = np.array([[250.0, 0.0, 79.5], [0.0, 250.0, 79.5], [0.0, 0.0, 1.0]])
    candidates, mask = seen_through(truth)
    near = rotate_to_view(candidates, view_vectors(camera, mask.shape, 0.0, 0.0))
    evidence = face_evidence(near, mask, inradius_of(mask), camera)
    assert np.count_nonzero(evidence) > 1000
    np.testing.assert_array_equal(evidence, face_evidence(candidates, mask, inradius_of(mask)))


def test_the_wall_of_a_cylinder_is_no_rounded_edge() -> None:
    """A flat strip seen through it, whose long edges lie along the axis, as all normals of the wall turn about it."""
    right, down = np.meshgrid(*(np.arange(size) - 79.5 for size in SHAPE))
    mask = (np.abs(right) < 40.0) & (np.abs(down) < 75.0)
    across = np.clip(right / 40.0, -1.0, 1.0)
    wall = np.where(mask[..., None], np.stack([across, 0.0 * down, np.sqrt(1.0 - across**2)], axis=-1), np.nan)
    strip = (right > -20.0) & (right < 0.0) & (np.abs(down) < 65.0)
    false = np.where(strip[..., None], unit(np.array([-0.6, 0.0, 0.8])), np.nan)
    assert proven_faces(np.stack([false, observable(wall)]), mask, inradius_of(mask)) == []
