import numpy as np
import pytest

from glint.tasks.algorithms.integration.contour_margin import least_cosines
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.expected_rises import expected_rises, poisson_source, robust_weights
from glint.tasks.algorithms.integration.graduation import (
    MISFIT_SCALE,
    SHRINKING,
    change,
    graduated,
    least_squares,
    normalized,
)
from glint.tasks.algorithms.integration.multigrid import solve_poisson
from glint.tasks.algorithms.integration.search_limits import TOLERANCE_PX, SearchLimits
from tests.benchmarks.integration_scenes import pleats, with_noise
from tests.benchmarks.integration_sheets import stairs


@pytest.mark.parametrize("degrees", [0.0, 1.0])
def test_a_height_that_has_converged_hardly_moves_if_its_last_round_is_solved_on(degrees: float) -> None:
    scene = with_noise(pleats(64, 0.3), degrees)
    weight = np.ones(scene.mask.shape)
    edges = grid_edges(scene.normals, scene.mask, weight, scene.camera, least_cosines(scene.mask))
    rises = expected_rises(edges)
    softness = np.ones((2, *rises.mean.shape))
    start = least_squares(edges).height
    solution = graduated(rises, softness, scene.mask, start, 2.0 * MISFIT_SCALE, SearchLimits())
    assert solution.converged
    weights = normalized(robust_weights(rises, solution.height, softness, MISFIT_SCALE))
    height = solve_poisson(weights, poisson_source(weights, rises.mean), solution.height, tolerance=1e-9)[0]
    height -= np.median((height - solution.height)[scene.mask])
    assert change(height, solution.height, scene.mask) < 2.0 * TOLERANCE_PX


def test_a_height_that_does_not_change_is_kept_only_at_the_final_scale() -> None:
    scene = stairs(24, 0.0)
    edges = grid_edges(scene.normals, scene.mask, np.ones(scene.mask.shape), scene.camera, 0.01)
    rises = expected_rises(edges)
    start, softness = least_squares(edges).height, np.ones((2, *rises.mean.shape))
    solution = graduated(rises, softness, scene.mask, start, MISFIT_SCALE / SHRINKING**2.5, SearchLimits())
    assert solution.converged and solution.rounds == 4
