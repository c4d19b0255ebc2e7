import numpy as np
import pytest

from glint.tasks.algorithms.integration.edges import GridEdges, grid_edges
from glint.tasks.algorithms.integration.expected_rises import (
    LEAST_NOISE,
    curl_evidence,
    expected_rises,
    largest_misfit,
    normal_evidence,
    robust_weights,
)
from tests.benchmarks.integration_scenes import Scene, with_noise
from tests.benchmarks.integration_sheets import risers, stairs


def edges_of(scene: Scene) -> GridEdges:
    return grid_edges(scene.normals, scene.mask, np.ones(scene.mask.shape), scene.camera, 0.01)


def test_the_noise_of_normals_is_measured_on_slopes_too() -> None:
    for tilt in (0.0, 1.5):
        scene = stairs(64, 0.0, bend=0.5, tilt=tilt)
        assert expected_rises(edges_of(scene)).noise == LEAST_NOISE
        for degrees in (2.0, 4.0):
            noise = np.degrees(expected_rises(edges_of(with_noise(scene, degrees))).noise)
            assert 0.7 * degrees < noise < 1.1 * degrees


def test_rises_are_less_precise_where_the_slope_changes_and_where_it_is_steep() -> None:
    edges = edges_of(risers(32, 8, 3.0, count=1))
    precision = expected_rises(edges).precision[1, 16]
    assert precision[23] < 0.01 * precision[10] and precision[27] < 0.1 * precision[10]
    assert precision[-1] == 0.0


def test_lines_of_curl_are_evidence_along_a_step_and_nowhere_else() -> None:
    scene = with_noise(stairs(64, 0.2), 1.0)
    edges = edges_of(scene)
    rises = expected_rises(edges)
    border = scene.steps[0][1]
    significance = np.sqrt(curl_evidence(edges, rises, (2, 4, 8)))
    assert significance[1, 15:35, border].min() > 10.0
    assert significance[1, :, border - 8].max() < 6.0
    assert np.median(significance[0]) < 3.0


def test_the_curl_of_uncertain_normals_is_less_evidence() -> None:
    edges = edges_of(with_noise(stairs(32, 0.2), 1.0))
    certain, uncertain = (
        curl_evidence(changed, expected_rises(changed), (2, 4))
        for changed in (edges, edges._replace(weight=np.full((32, 32), 0.5)))
    )
    assert np.allclose(uncertain, 0.25 * certain)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("place", [1, 15])
def test_the_largest_misfit_is_in_standard_deviations_along_either_axis(axis: int, place: int) -> None:
    rises = expected_rises(edges_of(stairs(16, 0.0)))
    step = np.where(np.arange(16) < place, 0.0, -2.0)
    height = step[:, None] * np.ones(16) if axis == 0 else np.ones((16, 1)) * step
    assert largest_misfit(rises, height) == pytest.approx(2.0 * np.sqrt(rises.precision.max()))
    assert largest_misfit(rises, np.ones((16, 16))) == 0.0


def test_creases_are_changes_of_the_normal_and_curvature_is_none() -> None:
    edges = edges_of(risers(32, 8, 3.0, count=1))
    significance = np.sqrt(normal_evidence(edges, expected_rises(edges)))
    assert significance[1, :, 23].min() > 10.0
    assert significance[1, :, :22].max() == 0.0
    curved = edges_of(stairs(64, 0.0, bend=1.0))
    assert normal_evidence(curved, expected_rises(curved)).max() == 0.0


def test_large_misfits_lose_their_weight_and_soft_edges_sooner() -> None:
    edges = edges_of(stairs(16, 0.0))
    rises = expected_rises(edges)
    height = np.zeros((16, 16))
    height[:, 8:] = 10 / np.sqrt(rises.precision[1, 0, 0])
    soft = np.ones((2, *rises.mean.shape))
    weights = robust_weights(rises, height, soft, 6.0)
    share = weights[1, 5, 7] / rises.precision[1, 5, 7]
    assert weights.max() == rises.precision.max() and 0.01 < share < 0.05
    # Down to the next pixel it is softer, which changes nothing for a step up.
    soft[0, 1, :, 7] = 0.01
    assert np.array_equal(robust_weights(rises, height, soft, 6.0), weights)
    assert robust_weights(rises, -height, soft, 6.0)[1, 5, 7] < 1e-4 * weights[1, 5, 7]
    soft[1, 1, :, 7] = 0.01
    assert robust_weights(rises, height, soft, 6.0)[1, 5, 7] < 1e-4 * weights[1, 5, 7]
