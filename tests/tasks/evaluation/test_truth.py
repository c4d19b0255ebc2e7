"""Ground truth of captures: pixels outside the object may hold NaN or zeros."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.errors import InputError
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.evaluation.truth import load_truth
from glint.tasks.stages.capture_geometry import load_geometry
from tests.tasks.make_context import make_context, perform_all


@pytest.fixture(scope="module")
def surveyed(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> CaptureContext:
    context = make_context(simulated, tmp_path_factory.mktemp("surveyed") / "store")
    perform_all(context, "survey")
    return context


@pytest.fixture
def context(surveyed: CaptureContext, tmp_path: Path) -> CaptureContext:
    """A surveyed capture whose truth is in a folder of its own, to be changed."""
    assert surveyed.capture.truth is not None
    truth, folder = read_truth(surveyed.capture.truth), tmp_path / "truth"
    folder.mkdir()
    assert truth.normals is not None and truth.depth is not None
    np.save(folder / "normals.npy", truth.normals)
    np.save(folder / "depth.npy", truth.depth)
    return replace(surveyed, capture=surveyed.capture.model_copy(update={"truth": str(folder)}))


def test_zeros_are_outside_the_object_like_nan(context: CaptureContext) -> None:
    path = Path(str(context.capture.truth)) / "normals.npy"
    normals = np.load(path)
    np.save(path, np.nan_to_num(normals))
    truth = load_truth(context, normals.shape[:2])
    assert truth is not None and truth.depth is not None
    assert np.isnan(normals).any() and np.array_equal(truth.normals, normals, equal_nan=True)


def test_without_true_normals_nothing_is_judged(context: CaptureContext) -> None:
    shape = np.load(Path(str(context.capture.truth)) / "depth.npy").shape
    (Path(str(context.capture.truth)) / "normals.npy").unlink()
    assert load_truth(context, shape) is None
    assert load_truth(replace(context, capture=context.capture.model_copy(update={"truth": None})), shape) is None


def test_normals_of_another_region_are_refused(context: CaptureContext) -> None:
    with pytest.raises(InputError, match=r"normals\.npy has shape") as raised:
        load_truth(context, (3, 4))
    assert raised.value.remedy.startswith("it must be 3 x 4 x 3, rows x columns of the region, or ")


def test_a_truth_of_the_full_frame_is_cropped_to_the_region(context: CaptureContext) -> None:
    geometry, folder = load_geometry(context), Path(str(context.capture.truth))
    region, (width, height) = geometry.region, geometry.frame_size
    own = {name: np.load(folder / f"{name}.npy") for name in ("normals", "depth")}
    for name, values in own.items():
        whole = np.full((height, width, *values.shape[2:]), np.nan, np.float32)
        whole[region.rows, region.columns] = values
        np.save(folder / f"{name}.npy", whole)
    truth = load_truth(context, (region.height, region.width))
    assert truth is not None and truth.depth is not None
    assert np.array_equal(truth.normals, own["normals"], equal_nan=True)
    assert np.array_equal(truth.depth, own["depth"], equal_nan=True)


@pytest.mark.parametrize(
    ("factor", "says"),
    [(0.42, r"rises 0\.42\d* times as much as the normals show"), (-1.0, "falls where the normals show that it rises")],
)
def test_depth_of_another_unit_or_direction_than_the_normals_is_refused(
    context: CaptureContext, factor: float, says: str
) -> None:
    path = Path(str(context.capture.truth)) / "depth.npy"
    depth = np.load(path)
    np.save(path, depth * factor)
    with pytest.raises(InputError, match=says):
        load_truth(context, depth.shape)
