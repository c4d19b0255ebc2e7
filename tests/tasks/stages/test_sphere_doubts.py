"""Doubt of spheres: small ones that were found, and what their fits leave uncertain in the half vectors."""

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.lights import ACCEPTED, Lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.stages.sphere_doubts import sphere_doubts, spheres_error, sweep_error

HALF_VECTORS = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]], np.float32)
UNKNOWN = np.full(2, np.nan, np.float32)
LIGHTS = Lights(HALF_VECTORS, HALF_VECTORS, np.full(2, ACCEPTED, np.uint8), UNKNOWN, UNKNOWN)


def doubts(sphere: Sphere) -> list[str]:
    """Return the causes of the warnings about a single sphere."""
    return [warning.message for warning in sphere_doubts([sphere], LIGHTS, is_near=False)]


def test_a_small_sphere_is_doubted_unless_it_was_given():
    assert any("radius of 17.0 pixels" in message for message in doubts(Sphere(0.0, 0.0, 17.0, 0.3)))
    assert doubts(Sphere(0.0, 0.0, 17.0, 1.0)) == []
    assert doubts(Sphere(0.0, 0.0, 40.0, 0.3)) == []


def test_a_badly_known_contour_is_doubted_with_a_remedy_that_helps():
    assert "or give `spheres`" in doubts(Sphere(0.0, 0.0, 40.0, 0.3, 0.8, 0.8))[0]
    assert "or a larger sphere" in doubts(Sphere(0.0, 0.0, 40.0, 1.0, 0.8, 0.8))[0]


def test_the_error_grows_towards_the_rim_and_falls_with_a_second_sphere():
    sphere = Sphere(0.0, 0.0, 50.0, 0.3, 0.5, 0.5)
    single, pair = (spheres_error([sphere] * count, HALF_VECTORS[:, 2]) for count in (1, 2))
    assert single[0] == pytest.approx(0.01) and single[1] > 1.1 * single[0]
    assert pair == pytest.approx(single / np.sqrt(2.0))
    assert sweep_error([], LIGHTS) == 0.0
