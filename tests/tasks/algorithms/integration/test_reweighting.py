"""The choice of steps: where the near side tilts towards the far one; and the energy of a height with steps."""

import numpy as np
import pytest

from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.reweighting import misfit_energy
from tests.benchmarks.integration_scenes import FIELDS, traced
from tests.benchmarks.integration_synthetic import error


def test_steps_are_looked_for_where_the_near_side_tilts_towards_the_far_one() -> None:
    scene = traced(FIELDS["boxes"], 48)
    assert error(scene, integrate(scene.normals, scene.mask).depth) < 1.0


def test_a_step_costs_no_energy_where_each_pixel_chooses_its_continuous_side() -> None:
    normals = np.broadcast_to([0.0, 0.0, 1.0], (5, 8, 3))
    edges = grid_edges(normals, np.ones((5, 8), bool), np.full((5, 8), 0.5), None, 0.01)
    height = np.where(np.arange(8) < 4, 0.0, 10.0) * np.ones((5, 1))
    assert misfit_energy(edges, height, 2.0) == pytest.approx(0.0, abs=1e-6)
    # Else half of the squared misfit of the pixels on both sides, by their weight.
    assert misfit_energy(edges, height, 0.0) == pytest.approx(5 * 2 * 0.5 * 0.5 * 100.0)
