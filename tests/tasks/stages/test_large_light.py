"""A light that is larger than usual: its broad highlights are no shading."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.tasks.make_context import make_context, perform_all


@pytest.mark.usefixtures("smooth_labels")
def test_broad_highlights_of_a_large_light_show_the_surface(tmp_path: Path) -> None:
    options = CaptureOptions(frames=400, scale=0.3, rays=1, seed=3, sphere_radius=30.0, light_radius=12.0)
    work = make_context(simulate("hemisphere", tmp_path / "capture", options).catalogue, tmp_path / "store")
    perform_all(work, "labels")
    assert 18.0 < work.load("lights").record["light_radius_degrees"] < 26.0
    clusters, labels = work.load("clusters"), work.load("labels")
    assert not clusters.record["warnings"]
    region, truth = work.capture.region, work.capture.truth
    assert region is not None and truth is not None
    normals = read_truth(truth, (region.height, region.width)).normals
    assert normals is not None
    accepted = labels.read("labels").any(axis=0)
    assert accepted.mean() > 0.2
    assert np.median(angles(labels.read("normals"), normals)[accepted]) < 4.0
