"""Evaluations of a run: a ground truth that cannot be used is named, and the other captures are evaluated."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.storage.inputs.masks_and_truth import read_truth
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.evaluation.evaluate_run import evaluate_captures, evaluate_models
from tests.tasks.make_context import make_context


@pytest.mark.long
def test_an_unusable_truth_does_not_stop_the_others(simulated: Path, performed: Path, tmp_path: Path) -> None:
    shutil.copytree(performed, tmp_path / "store")
    sound = make_context(simulated, tmp_path / "store")
    np.save(tmp_path / "normals.npy", np.ones((3, 4, 3)))
    capture = sound.capture.model_copy(update={"truth": str(tmp_path)})
    contexts = [replace(sound, capture=capture), sound]
    evaluations, faults = evaluate_captures(contexts, lambda name, message: None)
    assert len(evaluations) == 1
    assert "has shape 3 x 4 x 3" in faults[sound.name].message
    misnamed = sound.capture.model_copy(update={"truth": "http://host/truth"})
    _, faults = evaluate_captures([replace(sound, capture=misnamed)], lambda name, message: None)
    assert "http:// are not supported" in faults[sound.name].message


def test_a_truth_beside_the_observed_pixels_is_named(simulated: Path, performed: Path, tmp_path: Path) -> None:
    shutil.copytree(performed, tmp_path / "store")
    context = make_context(simulated, tmp_path / "store")
    assert context.capture.truth is not None
    truth = read_truth(context.capture.truth)
    assert truth.normals is not None and truth.depth is not None
    observed = (context.load("clusters").read("observations") > 0) & context.load("mask").read("mask")
    np.save(tmp_path / "normals.npy", np.where(observed[..., None], np.nan, truth.normals))
    beside = replace(context, capture=context.capture.model_copy(update={"truth": str(tmp_path)}))
    evaluations, faults = evaluate_captures([beside], lambda name, message: None)
    assert not evaluations and "no true normal" in faults[context.name].message
    np.save(tmp_path / "normals.npy", truth.normals)
    np.save(tmp_path / "depth.npy", np.full_like(truth.depth, np.nan))
    evaluations, faults = evaluate_captures([beside], lambda name, message: None)
    assert not evaluations and "no true depth" in faults[context.name].message


def test_an_unusable_true_model_is_named_like_a_truth_of_a_capture(simulated: Path, tmp_path: Path) -> None:
    context = make_context(simulated, tmp_path / "store")
    record = {"views": [{"capture": context.capture.id}], "left_out": [], "seconds": 1.0}
    context.repository.save(WHOLE_OBJECT, "model", "key", {}, record)
    catalogue = load(simulated)
    entries = tuple(item.model_copy(update={"truth_model": str(tmp_path / "absent.ply")}) for item in catalogue.objects)
    evaluations, faults = evaluate_models([context], catalogue.model_copy(update={"objects": entries}))
    assert evaluations == []
    assert "absent.ply does not exist" in faults[f"{context.object_id}/model"].message
