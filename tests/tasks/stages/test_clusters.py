"""Candidates of a simulated capture beside the true normals, with and without what dark frames tell."""

from pathlib import Path
from typing import Any

import numpy as np

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.tasks.make_context import make_context, perform_all


def candidates(catalogue: Path, store: Path, **parameters: Any) -> tuple[CaptureContext, np.ndarray]:
    """Return the context of a capture whose clusters are made, and its candidates (K, H, W, 3)."""
    work = make_context(catalogue, store, {"clusters": parameters})
    perform_all(work, "clusters")
    return work, work.load("clusters").read("normals")


def test_dark_frames_bring_candidates_closer_to_the_true_normals(simulated: Path, tmp_path: Path) -> None:
    work, centres = candidates(simulated, tmp_path / "store")
    _, means = candidates(simulated, tmp_path / "store", dark_frames=False)
    assert work.capture.truth is not None
    truth = read_truth(work.capture.truth, centres.shape[1:3]).normals
    assert truth is not None
    with_means = np.nan_to_num(angles(means, truth[None]), nan=180.0).min(axis=0)
    with_centres = np.nan_to_num(angles(centres, truth[None]), nan=180.0).min(axis=0)
    near = with_means < 9.0
    assert near.sum() > 500
    assert np.median(with_centres[near]) < 0.92 * np.median(with_means[near])


def test_between_the_few_lights_of_photographs_dark_frames_tell_nothing(tmp_path: Path) -> None:
    options = CaptureOptions(frames=90, scale=0.15, sphere_radius=22.0)
    catalogue = simulate("hemisphere", tmp_path / "capture", options).catalogue
    _, centres = candidates(catalogue, tmp_path / "store")
    _, means = candidates(catalogue, tmp_path / "store", dark_frames=False)
    assert np.isfinite(centres).any()
    np.testing.assert_array_equal(centres, means)
