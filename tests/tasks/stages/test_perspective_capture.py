"""A capture by a near camera, from the simulator to depth: with its matrix as good as any other, without it told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.storage.catalogue.models import Camera
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord
from glint.tasks.evaluation.captures import Evaluation, evaluate
from glint.tasks.pipeline import STAGES
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.camera_doubt import doubt_given_camera
from glint.tasks.stages.capture_geometry import load_geometry
from tests.tasks.make_context import make_context, perform_all
from tests.tasks.smooth_labels import smooth_labels

pytestmark = pytest.mark.usefixtures("smooth_labels")

NAMES = tuple(stage.name for stage in STAGES)


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = CaptureOptions(frames=500, scale=0.4, seed=3, focal=0.9)
    return simulate("hemisphere", tmp_path_factory.mktemp("near"), options).catalogue


def judged(work: CaptureContext) -> Evaluation:
    found = evaluate(work, NAMES)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def seen(near: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[CaptureContext, list[StageRecord]]:
    """The capture with its matrix, all stages performed; to be read only."""
    work = make_context(near, tmp_path_factory.mktemp("near-store") / "store")
    with smooth_labels():
        return work, perform_all(work)


def test_a_near_camera_needs_its_matrix_and_is_told_without(
    near: Path, seen: tuple[CaptureContext, list[StageRecord]], tmp_path: Path
) -> None:
    unknown = make_context(near, tmp_path / "without", camera=None)
    told = perform_all(unknown)
    given, without = judged(seen[0]), judged(unknown)
    assert given.method("glint").whole_mask.mean < 2.5 < 5.0 < without.method("glint").whole_mask.mean
    assert given.depth is not None and without.depth is not None
    assert given.depth.relative < 0.003 and 2 * given.depth.relative < without.depth.relative
    assert given.confident_right_share > 0.95
    assert not any(warning.cause == "camera" for record in seen[1] for warning in record.warnings)
    assert any("camera: {matrix" in warning.message for record in told for warning in record.warnings)
    assert without.confident_share < 0.05


@pytest.mark.parametrize("factor", [0.6, 3.0])
def test_normals_contradict_the_matrix_of_another_lens(near: Path, tmp_path: Path, factor: float) -> None:
    camera = load(near).objects[0].captures[0].camera
    assert camera is not None
    (focal, skew, x), (_, _, y), _ = camera.matrix
    wrong = Camera(matrix=((factor * focal, skew, x), (0.0, factor * focal, y), (0.0, 0.0, 1.0)))
    records = perform_all(make_context(near, tmp_path / "store", camera=wrong), "labels")
    (warning,) = [warning for record in records for warning in record.warnings if warning.cause == "camera"]
    assert f"a focal length of {factor * focal:.0f} pixels" in warning.message and "this resolution" in warning.message
    assert records[-1].counts["confident share"] < 0.05


def test_a_principal_point_beside_the_frame_s_middle_is_doubted_unless_normals_confirm_the_matrix(
    seen: tuple[CaptureContext, list[StageRecord]],
) -> None:
    work, _ = seen
    geometry, normals = load_geometry(work), work.load("labels").read("normals")
    assert geometry.camera is not None
    cropped = replace(geometry, camera=geometry.camera - np.array([[0, 0, 60], [0, 0, 0], [0, 0, 0]]))
    nothing = np.full_like(normals, np.nan)
    assert not doubt_given_camera(geometry, nothing, 0.001).warnings
    doubt = doubt_given_camera(cropped, nothing, 0.001)
    (warning,) = doubt.warnings
    assert "60 pixels beside" in warning.message and np.degrees(doubt.half_vector_sd).min() > 5.0
    assert not doubt_given_camera(cropped, normals, 0.001).warnings


def test_the_truth_is_seen_through_the_camera(near: Path) -> None:
    """On the rim the true normal is perpendicular to the pixel's ray; the object fills its region; marks glint."""
    from scipy import ndimage

    from glint.tasks.algorithms.geometry.perspective import view_vectors

    capture = load(near).objects[0].captures[0]
    assert capture.camera is not None and capture.region is not None and capture.truth is not None
    normals = np.load(Path(str(capture.truth)) / "normals.npy")
    mask = np.isfinite(normals[..., 0])
    rim = mask & ~ndimage.binary_erosion(mask)
    view = view_vectors(np.array(capture.camera.matrix), mask.shape, capture.region.x, capture.region.y)
    towards = (normals * view).sum(axis=-1)
    assert (towards[mask] >= -1e-6).all() and np.median(towards[rim]) < 0.2
    assert np.degrees(np.arcsin(np.abs(normals[rim][:, 2]))).max() > 12
    width = np.ptp(np.nonzero(mask.any(axis=0))[0])
    height = np.ptp(np.nonzero(mask.any(axis=1))[0])
    assert max(width / capture.region.width, height / capture.region.height) > 0.7


def test_a_principal_point_in_the_wrong_order_is_reported_before_any_stage_but_the_survey(
    near: Path, tmp_path: Path
) -> None:
    camera = load(near).objects[0].captures[0].camera
    assert camera is not None
    (focal, skew, x), (_, _, y), _ = camera.matrix
    wrong = Camera(matrix=((focal, skew, y), (0.0, focal, x), (0.0, 0.0, 1.0)))
    (record,) = perform_all(make_context(near, tmp_path / "store", camera=wrong), "survey")
    (warning,) = [warning for warning in record.warnings if warning.cause == "camera"]
    assert "with x and y exchanged" in warning.message
