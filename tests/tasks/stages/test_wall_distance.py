"""The light's distance by the wall of a body of revolution."""

import numpy as np
import pytest

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.algorithms.near_light.distance_by_wall import DistanceChange
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import load_clusters
from glint.tasks.stages.labels import load_view
from glint.tasks.stages.wall_distance import combined_distance, with_distance
from tests.tasks.make_context import make_context, perform_all

DISTANCE_WIDTHS = 2.5


@pytest.fixture(scope="module")
def glass(tmp_path_factory: pytest.TempPathFactory) -> CaptureContext:
    """A labelled cylinder under a near light, before a black background that does not show how near."""
    folder = tmp_path_factory.mktemp("wall")
    options = CaptureOptions(
        frames=400, scale=0.45, rays=1, seed=3, sphere_radius=24, light_distance=DISTANCE_WIDTHS, crf=30
    )
    work = make_context(simulate("cylinder", folder / "capture", options).catalogue, folder / "store")
    perform_all(work, "labels")
    return work


def test_the_wall_of_a_glass_shows_how_near_the_light_is(glass: CaptureContext) -> None:
    near, change = glass.load("lights").record["near_light"], glass.load("labels").record["inverse_distance_change"]
    before = 0.0 if near is None else 1.0 / near["distance"]
    true = 1.0 / (DISTANCE_WIDTHS * load_geometry(glass).frame_size[0])
    assert abs(before + change - true) < 0.5 * abs(before - true)
    assert abs(before + change - true) < 0.2 * true


def test_normals_are_those_of_the_corrected_light(glass: CaptureContext) -> None:
    capture = glass.capture
    assert capture.region is not None and capture.truth is not None
    truth = read_truth(capture.truth, (capture.region.height, capture.region.width)).normals
    assert truth is not None
    saved = glass.load("labels")
    error, is_confident = angles(saved.read("normals"), truth), saved.read("confidence") >= CONFIDENT
    assert is_confident.mean() > 0.05
    assert np.median(error[is_confident]) < 1.2


def test_the_view_is_that_which_was_labelled(glass: CaptureContext) -> None:
    change = glass.load("labels").record["inverse_distance_change"]
    clusters, view = load_clusters(glass), load_view(glass)
    assert np.nanmax(angles(view.clusters.normals, clusters.normals)) > 0.2
    back, _ = with_distance(view.clusters, None, load_geometry(glass), -change)
    assert np.nanmedian(angles(back.normals, clusters.normals)) < 0.05


def test_two_measurements_are_weighted_by_their_deviations(glass: CaptureContext) -> None:
    geometry = load_geometry(glass)
    combined = combined_distance(geometry, 1e-3, 2e-4, DistanceChange(3e-4, 1e-4))
    assert combined.change == pytest.approx(2.4e-4)
    assert not combined.warnings
    unmoved = combined_distance(geometry, 1e-3, 2e-4, DistanceChange(1e-6, 1e-4))
    assert unmoved.change == 0.0 and unmoved.variance_change.max() < 0.0
    settled = combined_distance(geometry, 1e-3, 2e-4, DistanceChange(3e-4, 1e-4), applied=2.1e-4)
    assert settled.change == 2.1e-4


def test_a_light_is_not_put_farther_away_than_infinity(glass: CaptureContext) -> None:
    combined = combined_distance(load_geometry(glass), 1e-4, 1e-3, DistanceChange(-5e-4, 1e-4))
    assert combined.change == -1e-4


def test_a_wall_that_contradicts_the_background_lowers_the_confidence(glass: CaptureContext) -> None:
    combined = combined_distance(load_geometry(glass), 1e-3, 1e-4, DistanceChange(2e-3, 1e-4))
    assert combined.change == 0.0 and np.median(combined.variance_change) > np.radians(1.0) ** 2
    (warning,) = combined.warnings
    assert "contradicts what the background shows" in warning.message and warning.cost_deg > 1.0
