import numpy as np
import pytest

from glint.tasks.algorithms.integration.contour_margin import least_cosines
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.expected_rises import expected_rises, poisson_source, robust_weights
from glint.tasks.algorithms.integration.graduation import (
    MISFIT_SCALE,
    change,
    graduated,
    least_squares,
    normalized,
)
from glint.tasks.algorithms.integration.multigrid import solve_poisson
from glint.tasks.algorithms.integration.search_limits import TOLERANCE_PX, SearchLimits
from tests.benchmarks.integration_scenes import pleats, with_noise


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
