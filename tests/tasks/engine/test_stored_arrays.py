"""A stage never stores what a version could not hold."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.errors import StoreError
from glint.tasks.engine.stage import StageOutput, perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES
from tests.tasks.make_context import make_context, perform_all

MASK = np.eye(4, dtype=bool)


@pytest.mark.parametrize(
    ("arrays", "violation"),
    [
        ({"mask": MASK}, "mask has no array doubt"),
        ({"mask": MASK, "doubt": np.full((4, 4), np.nan, np.float32)}, "mask/doubt has 16 values that are not finite"),
        ({"mask": MASK.astype(np.uint8), "doubt": np.zeros((4, 4), np.float32)}, "mask/mask is uint8"),
        ({"mask": MASK, "doubt": np.zeros((4, 5), np.float32)}, "mask/doubt has shape"),
    ],
)
def test_a_result_against_its_layout_is_not_stored(
    simulated: Path, tmp_path: Path, arrays: dict[str, Any], violation: str
) -> None:
    context = make_context(simulated, tmp_path / "store")
    perform_all(context, "frames")
    stage = replace(BY_NAME["mask"], run=lambda inputs, progress: StageOutput(arrays=arrays))
    with pytest.raises(StoreError, match=violation):
        perform(context, stage, stage_keys(context, STAGES)["mask"])
    with pytest.raises(StoreError):
        context.load("mask")


def test_values_must_be_finite_inside_the_stored_mask(simulated: Path, tmp_path: Path) -> None:
    context = make_context(simulated, tmp_path / "store")
    perform_all(context, "markup")
    mask = context.load("mask").read("mask")
    initial = np.full((*mask.shape, 3), np.nan, np.float32)
    arrays = {"rim": mask, "initial": initial}
    stage = replace(BY_NAME["silhouette"], run=lambda inputs, progress: StageOutput(arrays=arrays))
    key = stage_keys(context, STAGES)["silhouette"]
    with pytest.raises(StoreError, match=f"silhouette/initial has {3 * mask.sum():,} values that are not finite"):
        perform(context, stage, key)
    initial[mask] = 0.0
    assert perform(context, stage, key).stage == "silhouette"
