from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, reconstruct_normals, settle
from glint.tasks.algorithms.labelling.results import PROVENANCE, Reconstruction, exterior_normals
from glint.tasks.algorithms.labelling.weights import DEFAULT_OPTIONS, LabellingOptions
from tests.tasks.algorithms.faces.polyhedron import PYRAMID, face_numbers, polyhedron_normals
from tests.tasks.algorithms.labelling.scenes import SHEETS_ALONE, Scene, clusters_of, head_with_ear, pebble
from tests.tasks.algorithms.revolution.beaker import bowl_on_stem, false_sheets, observable, seen_bowl, seen_normals
from tests.tasks.algorithms.revolution.cylinder import CAMERA, SHAPE, seen_cylinder


@pytest.fixture(scope="module")
def scene() -> Scene:
    return pebble()


@pytest.fixture(scope="module")
def result(scene: Scene) -> Reconstruction:
    return reconstruct_normals(scene[0], scene[1], SHEETS_ALONE)


def test_a_sheet_is_doubted_where_the_rest_of_the_object_shows_false_highlights_alone() -> None:
    clusters, mask, truth = pebble()
    patch = (np.abs(np.indices(mask.shape) - 44.5) < 10).all(axis=0)
    right = angles(clusters.normals, truth[None]) < 3
    alone = np.where((right & patch)[..., None], clusters.normals, np.nan)
    scattered = unit(np.random.default_rng(1).normal(0.0, 0.5, truth.shape) + np.array([0.0, 0.0, 1.0]))
    beside = np.where((mask & ~patch)[None, ..., None], scattered.astype(np.float32), alone)
    results = [reconstruct_normals(clusters_of(nodes), mask, SHEETS_ALONE) for nodes in (alone, beside)]
    for result in results:
        accepted = (result.labels > 0).any(axis=0)
        assert (accepted & patch).sum() > 0.7 * accepted.sum()
        assert accepted.sum() > 0.5 * patch.sum()
    certain, doubted = (np.median(result.confidence[patch & (result.labels > 0).any(axis=0)]) for result in results)
    assert certain > 0.97
    assert doubted < 0.9


@pytest.mark.long
def test_the_exterior_sheet_is_found_and_the_false_one_rejected(scene: Scene, result: Reconstruction) -> None:
    clusters, _, truth = scene
    right = angles(clusters.normals, truth[None]) < 3
    labels = result.labels > 0
    assert (labels & right).sum() > 0.97 * labels.sum()
    assert (labels & right).sum() > 0.95 * right.sum()
    assert labels.sum(axis=0).max() == 1


def test_the_result_is_better_than_the_silhouette_alone(scene: Scene, result: Reconstruction) -> None:
    _, mask, truth = scene

    def error(normals: np.ndarray) -> float:
        return float(np.mean(((normals - truth)[mask] ** 2).sum(axis=-1)))

    assert error(result.normals) < 0.5 * error(result.initial)
    assert error(result.normals) < 0.02


def test_the_iterations_converge(result: Reconstruction) -> None:
    assert len(result.iterations) < 10
    assert result.iterations[-1].changed < result.iterations[0].changed


def test_provenance_and_confidence_are_right(scene: Scene, result: Reconstruction) -> None:
    _, mask, truth = scene
    observed = result.provenance == PROVENANCE.index("observed")
    assert np.array_equal(observed, result.labels.any(axis=0))
    assert np.array_equal(result.provenance == PROVENANCE.index("outside"), ~mask)
    assert np.isnan(result.confidence[~mask]).all() and np.isfinite(result.confidence[mask]).all()
    confident = mask & (result.confidence >= 0.95)
    assert confident.sum() > mask.sum() / 3
    assert (angles(result.normals, truth)[confident] < 5).mean() > 0.95


@pytest.mark.long
def test_marks_pin_their_nodes(scene: Scene) -> None:
    clusters, mask, truth = scene
    row, column = np.argwhere(mask & np.isfinite(clusters.normals[..., 0]).all(axis=0))[300]
    exterior = int(angles(clusters.normals[:, row, column], truth[row, column]).argmin())
    wrong = Marks(
        pixels=np.array([[row, column], [row, column]]),
        half_vectors=clusters.normals[[1 - exterior, exterior], row, column],
        kind=np.array([1, 0]),
    )
    result = reconstruct_normals(clusters, mask, SHEETS_ALONE, marks=wrong)
    assert result.labels[:, row, column].tolist() == [exterior, 1 - exterior]
    assert result.provenance[row, column] == PROVENANCE.index("marked")
    # The mark speaks for its sheet too, so that the field comes near and the normal is denoised.
    assert angles(result.normals[row, column], clusters.normals[1 - exterior, row, column]) < 2.0
    assert angles(result.normals[row, column], truth[row, column]) > 8.0


@pytest.mark.long
def test_marks_that_confirm_labels_change_no_normal(scene: Scene, result: Reconstruction) -> None:
    """They say which highlights are true, and are less exact than the clusters: by 2 degrees in this case."""
    clusters, mask, _ = scene
    pixels = np.argwhere(result.labels.any(axis=0))[::40]
    noise = np.random.default_rng(0).normal(0.0, 0.03, (len(pixels), 3))
    half_vectors = unit(exterior_normals(clusters.normals, result.labels)[tuple(pixels.T)] + noise).astype(np.float32)
    marks = Marks(pixels, half_vectors, np.ones(len(pixels), np.int8))
    marked = reconstruct_normals(clusters, mask, SHEETS_ALONE, marks=marks)
    assert np.array_equal(marked.labels, result.labels)
    np.testing.assert_allclose(marked.normals, result.normals, atol=1e-6)
    assert (marked.confidence >= result.confidence - 1e-6)[mask].all()
    assert (marked.confidence[tuple(pixels.T)] == 1.0).all()


def test_without_highlights_the_silhouette_remains(scene: Scene) -> None:
    clusters, mask, _ = scene
    result = reconstruct_normals(clusters_of(np.full_like(clusters.normals, np.nan)), mask)
    assert np.allclose(result.normals[mask], result.initial[mask])
    assert not result.labels.any() and np.nanmax(result.confidence) < 0.95


def test_a_mask_of_another_size_is_refused(scene: Scene) -> None:
    with pytest.raises(ValueError, match="do not fit"):
        reconstruct_normals(scene[0], np.ones((3, 3), dtype=bool))


def test_expected_normals_replace_the_occluding_contour(scene: Scene, result: Reconstruction) -> None:
    clusters, mask, truth = scene
    informed = reconstruct_normals(clusters, mask, expected=np.where(mask[..., None], truth, np.nan))
    assert np.nanmean(angles(informed.normals, truth)) < 0.5 * np.nanmean(angles(result.normals, truth))
    holed = truth.copy()
    holed[mask.nonzero()[0][0], mask.nonzero()[1][0]] = np.nan
    with pytest.raises(ValueError, match="leave pixels"):
        reconstruct_normals(clusters, mask, expected=holed)


@pytest.mark.long
def test_a_turned_glass_is_known_at_its_end() -> None:
    from tests.tasks.algorithms.revolution.beaker import beaker_normals, observable

    truth = beaker_normals(20.0)
    mask = np.isfinite(truth[..., 0])
    clusters = clusters_of(observable(truth)[None].astype(np.float32))
    result = reconstruct_normals(clusters, mask)
    without = reconstruct_normals(clusters, mask, LabellingOptions(symmetry=False))
    end = mask & (truth @ np.array([0.0, np.cos(np.radians(20.0)), np.sin(np.radians(20.0))]) > 0.99)
    assert np.median(angles(result.normals, truth)[end]) < 8.0
    assert np.median(angles(without.normals, truth)[end]) > 15.0


@pytest.mark.long
def test_labels_that_accept_nothing_start_from_the_surface_that_candidates_show() -> None:
    truth = seen_normals(bowl_on_stem(14.0))
    mask = np.isfinite(truth[..., 0])
    false = np.where(mask[..., None], false_sheets(2), np.nan)
    clusters = clusters_of(np.concatenate([observable(truth)[None], false]).astype(np.float32))
    empty = settle(clusters, mask, LabellingOptions(max_iterations=0))
    assert not empty.labels.any()
    empty.options = DEFAULT_OPTIONS
    result = conclude(explain(empty))
    assert np.median(angles(result.normals, truth)[mask]) < 1.0


@pytest.mark.long
def test_a_bowl_into_which_the_camera_looks_is_no_dome() -> None:
    truth, _ = seen_bowl(40.0)
    mask = np.isfinite(truth[..., 0])
    clusters = clusters_of(observable(truth)[None].astype(np.float32))
    with_bowl, without = (
        angles(reconstruct_normals(clusters, mask, LabellingOptions(symmetry=symmetry)).normals, truth)[mask]
        for symmetry in (True, False)
    )
    assert np.median(with_bowl) < 2.0 and np.mean(without) > 3.0 * np.mean(with_bowl)


@pytest.mark.long
def test_a_glass_before_a_near_camera_comes_right_with_the_matrix_alone() -> None:
    truth, distances = seen_cylinder(20.0, 12.0)
    truth, mask = rotate_to_view(truth, view_vectors(CAMERA, SHAPE, 0.0, 0.0)), np.isfinite(distances)
    clusters = clusters_of(observable(truth)[None].astype(np.float32))
    result, without = (reconstruct_normals(clusters, mask, camera=camera) for camera in (CAMERA, None))
    error, former = (angles(labelled.normals, truth)[mask].mean() for labelled in (result, without))
    assert result.body_depth is not None and error < 0.25 * former


def test_the_noise_of_accepted_normals_is_smoothed_away(scene: Scene, result: Reconstruction) -> None:
    clusters, _, truth = scene
    taken = result.provenance == PROVENANCE.index("observed")
    raw = np.take_along_axis(clusters.normals, result.labels.argmax(axis=0)[None, :, :, None], axis=0)[0]
    assert np.median(angles(result.normals, truth)[taken]) < 0.7 * np.median(angles(raw, truth)[taken])


@pytest.mark.long
def test_flat_faces_come_right_where_no_light_was_seen() -> None:
    truth = polyhedron_normals(PYRAMID)
    mask = np.isfinite(truth[..., 0])
    noise = np.random.default_rng(1).normal(0.0, 0.002, truth.shape)
    clusters = clusters_of(unit(observable(truth) + noise)[None].astype(np.float32))
    clusters = replace(clusters, weight=2.0 * clusters.weight)
    with_faces = reconstruct_normals(clusters, mask, LabellingOptions(symmetry=False))
    without = reconstruct_normals(clusters, mask, SHEETS_ALONE)
    unseen = mask & (face_numbers(PYRAMID) == 2)
    error, former = (angles(result.normals, truth)[unseen].mean() for result in (with_faces, without))
    assert error < 0.7 * former
    assert angles(with_faces.normals, truth)[mask & ~unseen].mean() < 1.5
    # What follows from creases alone is not as sure as what was seen.
    assert np.median(with_faces.confidence[unseen]) < 0.95


def test_faces_that_candidates_prove_count_once() -> None:
    truth = polyhedron_normals(PYRAMID, rounding=1.5)
    mask = np.isfinite(truth[..., 0])
    settled = settle(clusters_of(observable(truth)[None].astype(np.float32)), mask, LabellingOptions(symmetry=False))
    explained = explain(settled)
    evidence = explained.face_evidence
    assert (evidence > 0.0).sum() > 1000 and not settled.face_evidence.any()
    assert np.array_equal(explain(explained).face_evidence, evidence)
    settled.options = SHEETS_ALONE
    assert not explain(settled).face_evidence.any()


def test_a_sheet_before_the_body_is_accepted_though_the_silhouette_says_nothing_of_it() -> None:
    (clusters, mask, truth), ear = head_with_ear()
    result = reconstruct_normals(clusters, mask, SHEETS_ALONE)
    assert result.labels.any(axis=0)[ear].mean() > 0.8
    assert np.median(angles(result.normals, truth)[ear]) < 3.0
    assert np.median(angles(result.initial, truth)[ear]) > 30.0


def test_a_false_sheet_of_that_size_is_not_accepted() -> None:
    (clusters, mask, truth), ear = head_with_ear()
    # Light that crosses the glass shows a sheet that is turned inwards and whose gradients have a curl.
    p, q = -truth[..., 0] / truth[..., 2], -truth[..., 1] / truth[..., 2]
    false = unit(np.stack([p + 0.5 * q, q - 0.5 * p, np.ones_like(p)], axis=-1))
    clusters.normals[0][ear] = false[ear]
    result = reconstruct_normals(clusters, mask, SHEETS_ALONE)
    assert result.labels.any(axis=0)[ear].mean() < 0.1
