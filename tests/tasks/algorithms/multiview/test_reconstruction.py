"""A figurine on a turntable: its hull, its model, its poses; and clear errors for what cannot work."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.evaluation.mesh_metrics import ModelScore, score_model
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.normal_fusion import fuse_normals
from glint.tasks.algorithms.multiview.poisson import align_depth, merge_depth_maps
from glint.tasks.algorithms.multiview.raycast import expected_normals, raycast
from glint.tasks.algorithms.multiview.reconstruction import reconstruct_surface, simplify, with_confidence
from glint.tasks.algorithms.multiview.view import SilhouetteMask, View
from glint.tasks.algorithms.multiview.visual_hull import hull_field, hull_model
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.registered_views import refine, register_by_matrices, register_on_turntable
from glint.tasks.algorithms.registration.turntable import Turntable, views_on_turntable
from tests.tasks.algorithms.multiview.figurine import FRAME, body, full_view, true_model, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)


@pytest.fixture(scope="module")
def truth() -> trimesh.Trimesh:
    return body()


@pytest.fixture(scope="module")
def upright(truth: trimesh.Trimesh) -> list[View]:
    return views_of(truth, Turntable(0.0, 0.0, 0.0, ANGLES))


@pytest.fixture(scope="module")
def hull(upright: list[View]) -> Model:
    return hull_model(upright, 6000)


@pytest.fixture(scope="module")
def model(upright: list[View], hull: Model) -> Model:
    return reconstruct_surface(upright, hull, rounds=2, steps=5)


def test_labels_that_derive_from_a_model_do_not_confirm_it(upright: list[View], truth: trimesh.Trimesh) -> None:
    """Views labelled again have the model's normals, and are sure of them; their own labels are not."""
    model = true_model(truth)
    sure, unsure = (
        [view.with_normals(raycast(model, view)[1], np.where(view.mask, level, np.nan)) for view in upright]
        for level in (0.98, 0.5)
    )
    mesh = model.vertices, model.triangles, model.cell
    alone, confirmed, unconfirmed = (with_confidence(sure, *mesh, independent=own) for own in (None, sure, unsure))
    assert np.median(alone.confidence) > 0.95 and np.median(confirmed.confidence) > 0.95
    seen_twice = (fuse_normals(unsure, *mesh[:2]).confidences > 0.4).sum(axis=0) == 2
    assert seen_twice.sum() > 30 and 0.6 < np.median(unconfirmed.confidence[seen_twice]) < 0.76
    wrong = [view.with_normals(view.normals[..., [1, 0, 2]], view.evidence) for view in sure]
    contradicted = with_confidence(sure, *mesh, independent=wrong).confidence
    assert np.median(contradicted) < 0.4


def scored(model: Model, truth: trimesh.Trimesh) -> ModelScore:
    return score_model(model.vertices, model.triangles, truth, 20_000)


@pytest.mark.long
def test_the_hull_holds_the_body(upright: list[View], hull: Model, truth: trimesh.Trimesh) -> None:
    field = hull_field(upright)
    assert field(np.asarray(truth.vertices)).max() < 0.53
    assert field(np.asarray(truth.vertices) * 1.3).max() > 3.0
    assert trimesh.Trimesh(hull.vertices, hull.triangles, process=False).volume > 1.02 * truth.volume
    assert (hull.source == -1).all() and (hull.confidence == 0).all()


@pytest.mark.long
def test_the_model_is_much_nearer_than_the_hull(hull: Model, model: Model, truth: trimesh.Trimesh) -> None:
    before, after = scored(hull, truth), scored(model, truth)
    assert after.chamfer < 0.49 * before.chamfer and after.chamfer < 0.0044
    assert after.f_scores[1] > 0.998 and before.f_scores[1] < 0.75
    assert after.normals > 0.9959


def test_the_model_is_closed_and_turned_outwards(model: Model) -> None:
    mesh = trimesh.Trimesh(model.vertices, model.triangles, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert len(mesh.split()) == 1
    assert np.allclose(np.linalg.norm(model.normals, axis=1), 1.0)


def test_what_no_view_saw_is_marked(upright: list[View], model: Model) -> None:
    """The cameras stand level: nobody sees the top of the body or its underside."""
    upwards = model.normals[:, 1] > 0.98
    assert upwards.any() and (model.confidence[upwards] < 0.5).all()
    frontal = np.abs(model.normals[:, 1]) < 0.2
    assert (model.confidence[frontal] > 0.5).mean() > 0.95
    assert set(np.unique(model.source)) <= set(range(-1, len(upright)))


def test_normals_that_disagree_are_outvoted(upright: list[View], model: Model) -> None:
    """Of the views that see the front right, one is wrong by a quarter turn there and counts for nothing."""
    good = fuse_normals(upright, model.vertices, model.triangles)
    bad = upright[1].with_normals(
        upright[1].normals @ Rotation.from_euler("y", 50, degrees=True).as_matrix().T, upright[1].confidence
    )
    mixed = fuse_normals([upright[0], bad, *upright[2:]], model.vertices, model.triangles)
    several = (good.evidences > 0.5).sum(axis=0) >= 3
    angle = np.degrees(np.arccos(np.clip((good.normals * mixed.normals).sum(axis=1), -1, 1)))
    assert several.any() and np.median(angle[several]) < 0.58


def test_doubts_that_all_normals_share_lower_the_confidence_and_change_no_normal(
    upright: list[View], model: Model
) -> None:
    trusted = fuse_normals(upright, model.vertices, model.triangles)
    doubted = fuse_normals([replace(view, trust=0.5) for view in upright], model.vertices, model.triangles)
    assert np.array_equal(doubted.normals, trusted.normals) and np.array_equal(doubted.evidences, trusted.evidences)
    assert np.allclose(doubted.confidence, 0.5 * trusted.confidence)


def test_a_reduced_model(upright: list[View], model: Model, truth: trimesh.Trimesh) -> None:
    small = simplify(model, upright, 1500)
    assert len(small.triangles) <= 1500 and trimesh.Trimesh(small.vertices, small.triangles).is_watertight
    assert scored(small, truth).chamfer < 0.0044


def test_the_model_seen_by_a_view(truth: trimesh.Trimesh, upright: list[View]) -> None:
    depth, normals = raycast(true_model(truth), upright[2])
    shared = np.isfinite(depth) & upright[2].mask
    assert shared.sum() > 0.99 * upright[2].mask.sum()
    confident = upright[2].confidence > 0.9
    assert np.median((normals[confident] * upright[2].normals[confident]).sum(axis=1)) > 0.99976
    filled = expected_normals(true_model(truth), upright[2])
    assert np.isfinite(filled[upright[2].mask]).all() and np.isnan(filled[~upright[2].mask]).all()


@pytest.mark.long
def test_depth_maps_merge(truth: trimesh.Trimesh, upright: list[View]) -> None:
    depths = [raycast(true_model(truth), view)[0] for view in upright]
    exact = [view.with_normals(raycast(true_model(truth), view)[1], view.confidence) for view in upright]
    merged = merge_depth_maps(exact, depths, 1.0)
    assert scored(merged, truth).chamfer < 0.004
    assert (merged.source >= 0).mean() > 0.95
    # What no depth map shows is closed all the same.
    front = merge_depth_maps(exact[:1], depths[:1], 2.0)
    is_back = front.vertices[:, 2] < front.vertices[:, 2].min() + 4.0
    assert (front.source == 0).any() and (front.source[is_back] == -1).all() and not front.confidence[is_back].any()


def test_a_depth_map_is_shifted_to_the_hull(truth: trimesh.Trimesh, upright: list[View]) -> None:
    depth = raycast(true_model(truth), upright[1])[0]
    aligned = align_depth(true_model(truth), upright[1], np.where(depth > 0.0, depth + 7.0, np.nan))
    assert np.allclose(aligned[depth > 0.0], depth[depth > 0.0], atol=1e-3)
    unknown = np.full_like(depth, np.nan)
    assert np.isnan(align_depth(true_model(truth), upright[1], unknown)).all()


@pytest.mark.long
def test_a_leaning_displaced_turntable_is_solved(truth: trimesh.Trimesh) -> None:
    wanted = Turntable(3.0, 1.2, -1.5, ANGLES)
    views = views_of(truth, wanted)
    registered = register_on_turntable(views, ANGLES.tolist())
    assert registered.turntable is not None and not registered.rejected
    assert registered.turntable.offset == pytest.approx(3.0, abs=0.012)
    assert registered.turntable.lean_to_camera == pytest.approx(1.2, abs=0.1)
    assert registered.turntable.lean_right == pytest.approx(-1.5, abs=0.015)
    assert max(registered.residuals) < 0.015


@pytest.mark.long
def test_angles_are_corrected_by_normals(truth: trimesh.Trimesh, hull: Model) -> None:
    errors = np.array([0.9, -0.8, 0.7, -0.9, 0.8, -0.6, -0.7, 0.6])
    errors -= errors.mean()
    views = views_of(truth, Turntable(0.0, 0.0, 0.0, ANGLES + errors))
    registered = register_on_turntable(views, ANGLES.tolist())
    for _ in range(2):
        hull = reconstruct_surface(registered.views, hull, rounds=1, steps=5)
        registered = refine(registered, hull)
    assert registered.turntable is not None
    left = registered.turntable.angles - (ANGLES + errors)
    assert np.abs(left - left.mean()).mean() < 0.3


@pytest.mark.long
def test_a_wrong_angle_is_named_and_rejected(truth: trimesh.Trimesh) -> None:
    views = views_of(truth, Turntable(0.0, 0.0, 0.0, ANGLES))
    given = ANGLES.copy()
    given[3] += 25.0
    registered = register_on_turntable(views, given.tolist())
    assert [view.name for view in registered.rejected] == ["view-3"]
    assert registered.rejected[0].angle == pytest.approx(ANGLES[3], abs=0.6)
    assert (
        "-25" in registered.rejected[0].reason
        or "-24" in registered.rejected[0].reason
        or "-26" in registered.rejected[0].reason
    )
    assert len(registered.views) == 7 and max(registered.residuals) < 0.001


def test_a_mask_that_contradicts_the_others_is_named(upright: list[View]) -> None:
    halved = upright[2].mask.copy()
    halved[: FRAME[1] // 2] = False
    views = [*upright[:2], upright[2].with_mask(halved), *upright[3:]]
    registered = register_by_matrices(views)
    assert [view.name for view in registered.rejected] == ["view-2"]
    assert "contradicts" in registered.rejected[0].reason


def test_matrices_are_taken_as_they_are(upright: list[View]) -> None:
    registered = register_by_matrices(upright)
    assert not registered.rejected and registered.turntable is None
    assert all(
        (view.rotation == original.rotation).all() for view, original in zip(registered.views, upright, strict=True)
    )


def test_residuals_are_zero_only_for_true_poses(upright: list[View]) -> None:
    assert silhouette_residuals(upright).max() < 0.01
    shifted = views_on_turntable(upright, Turntable(3.0, 0.0, 0.0, ANGLES))
    assert silhouette_residuals(shifted).mean() > 1.58


def test_one_view_is_too_few(upright: list[View]) -> None:
    with pytest.raises(UnusableCapture, match="1 view with a pose"):
        register_by_matrices(upright[:1])
    with pytest.raises(UnusableCapture, match="1 view with a pose"):
        register_on_turntable(upright[:1], [0.0])


def test_a_pose_that_is_no_rotation(upright: list[View]) -> None:
    mirrored = upright[1].with_pose(upright[1].rotation @ np.diag([1.0, 1.0, -1.0]), upright[1].translation)
    with pytest.raises(UnusableCapture, match=r"pose of view-1 is not a rotation"):
        register_by_matrices([upright[0], mirrored, upright[2]])


def test_views_without_a_common_point(upright: list[View]) -> None:
    """Two views of two different places."""
    moved = upright[2].with_pose(upright[2].rotation, upright[2].translation + np.array([0.0, 300.0, 0.0]))
    with pytest.raises(UnusableCapture, match="no point in common"):
        reconstruct_surface([upright[0], moved])


def test_depth_maps_without_any_depth(upright: list[View]) -> None:
    with pytest.raises(UnusableCapture, match="no closed surface runs through 0 points"):
        merge_depth_maps(upright[:2], [np.full(FRAME[::-1], np.nan)] * 2, 1.0)


def test_a_perspective_view(truth: trimesh.Trimesh) -> None:
    """Through a camera matrix rays, projection and footprint agree."""
    matrix = np.array([[400.0, 0.0, 47.5], [0.0, 400.0, 47.5], [0.0, 0.0, 1.0]])
    view = full_view("near", matrix).with_pose(np.eye(3), np.array([0.0, 0.0, -400.0]))
    depth, normals = raycast(true_model(truth), view)
    rows, columns = np.nonzero(np.isfinite(depth))
    starts, directions = view.rays(columns, rows)
    points = (
        starts + ((depth[rows, columns] - starts[:, 2] - view.translation[2]) / directions[:, 2])[:, None] * directions
    )
    back = view.project(points)
    assert np.allclose(back[0], columns, atol=1e-2) and np.allclose(back[1], rows, atol=1e-2)
    assert cKDTree(truth.vertices).query(points)[0].max() < 0.65
    assert view.footprint(np.zeros((1, 3)))[0] == pytest.approx(1.0)
    assert np.allclose(view.view_vectors(points), -directions, atol=1e-6)
    assert np.isfinite(normals[rows, columns]).all()


@pytest.mark.long
def test_two_views_close_to_each_other(upright: list[View]) -> None:
    """Their hull runs far out; it is cut off, not lost."""
    merged = reconstruct_surface(upright[:2], hull_model(upright[:2], 3000), 1, 2)
    assert trimesh.Trimesh(merged.vertices, merged.triangles, process=False).is_watertight


@pytest.mark.long
def test_a_view_without_known_normals_adds_its_outline(upright: list[View], truth: trimesh.Trimesh) -> None:
    unknown = upright[1].with_normals(np.full_like(upright[1].normals, np.nan), np.zeros_like(upright[1].confidence))
    views = [upright[0], unknown, *upright[2:]]
    merged = reconstruct_surface(views, hull_model(views, 3000), rounds=2, steps=4)
    assert scored(merged, truth).chamfer < 0.0047
    assert (merged.confidence[merged.source == 1] == 0).all()


@pytest.mark.long
def test_views_of_different_pixel_sizes(upright: list[View], truth: trimesh.Trimesh) -> None:
    """One view was filmed from nearer: its pixels cover half as much."""
    frame = (2 * FRAME[0], 2 * FRAME[1])
    view = upright[1]

    def doubled(values: np.ndarray) -> np.ndarray:
        return values.repeat(2, axis=0).repeat(2, axis=1)

    nearer = replace(view, silhouette=SilhouetteMask(doubled(view.mask)), normals=doubled(view.normals),
                     evidence=doubled(view.evidence), frame=frame, pixel_size=0.5)  # fmt: skip
    views = [upright[0], nearer, *upright[2:]]
    registered = register_by_matrices(views)
    assert not registered.rejected and max(registered.residuals) < 0.031
    merged = reconstruct_surface(views, hull_model(views, 6000), rounds=2, steps=5)
    assert scored(merged, truth).chamfer < 0.0044


def test_a_surface_that_has_not_the_views_normals_is_not_confident(truth: trimesh.Trimesh, upright: list[View]) -> None:
    exact = true_model(truth)
    right = with_confidence(upright, exact.vertices, exact.triangles, exact.cell)
    # Ripples of 8 degrees that no view shows.
    wavelength, height = 6.0, 6.0 / (2.0 * np.pi) * np.tan(np.radians(8.0))
    ripples = height * np.sin(2.0 * np.pi * exact.vertices[:, 1] / wavelength)
    rippled = exact.vertices + ripples[:, None] * exact.normals
    wrong = with_confidence(upright, rippled, exact.triangles, exact.cell)
    assert (wrong.confidence > 0.9).mean() < 0.4 * (right.confidence > 0.9).mean()
