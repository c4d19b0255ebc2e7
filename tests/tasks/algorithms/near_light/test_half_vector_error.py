from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.half_vector_error import (
    PixelGrid,
    combined_error,
    depth_error,
    light_distance_error,
    spheres_error,
    unknown_camera_error,
    unknown_distance_error,
)
from tests.tasks.algorithms.near_light.two_spheres import spiral

PIXELS = PixelGrid.of(100, 50, 200, 120)
SPHERE = Sphere(360.0, 110.0, 30.0)


def size_deg(error: np.ndarray) -> np.ndarray:
    """Return the root mean square angle in degrees of an error by its deviation per axis."""
    return np.degrees(np.sqrt(2.0) * error)


def test_independent_errors_add_in_quadrature() -> None:
    parts = [np.full((2, 2), 0.03), np.full((2, 2), 0.04)]
    assert np.allclose(combined_error(parts), 0.05)
    assert combined_error(parts).dtype == np.float32


def test_an_unknown_distance_costs_the_parallax_of_the_least_recommended_one() -> None:
    """Ten sizes of the object: checked against half vectors of a light there, over a whole sweep."""
    positions = 2000.0 * spiral(500, 85.0)
    error = np.degrees(unknown_distance_error(PIXELS, [SPHERE]))
    for row, column in ((10, 5), (60, 100), (100, 190)):
        offset = np.array([column + 100 - SPHERE.x, SPHERE.y - row - 50, 0.0])
        exact = angles(half_vectors_of(unit(positions)), half_vectors_of(unit(positions - offset)))
        assert abs(error[row, column] / np.sqrt((exact**2).mean()) - 1) < 0.25


def test_a_better_known_distance_costs_less() -> None:
    unknown, known = unknown_distance_error(PIXELS, [SPHERE]), light_distance_error(PIXELS, [SPHERE], 1e-5)
    assert (known < 0.05 * unknown).all() and (known > 0).all()


def test_the_distance_costs_nothing_at_the_spheres() -> None:
    pair = [Sphere(100.0, 110.0, 30.0), Sphere(300.0, 110.0, 30.0)]
    assert light_distance_error(PIXELS, pair, 1e-3)[60, 100] < 1e-9


def test_a_sphere_that_is_badly_known_costs_nothing_beside_a_good_one() -> None:
    good, bad = replace(SPHERE, centre_sd=0.3, radius_sd=0.3), replace(SPHERE, x=160.0, centre_sd=3.0, radius_sd=3.0)
    nz = np.array([1.0, 0.8])
    of_good, of_bad, of_both = (spheres_error(spheres, nz) for spheres in ([good], [bad], [bad, good]))
    assert (of_both < 1.1 * of_good).all() and (of_good < 0.2 * of_bad).all()
    assert np.allclose(spheres_error([good, good], nz), of_good / np.sqrt(2.0))
    distance = light_distance_error(PIXELS, [bad, good], 1e-3)
    assert np.unravel_index(distance.argmin(), distance.shape)[1] == 199


def test_heights_cost_more_under_a_nearer_light() -> None:
    near, far = depth_error(PIXELS, 1e-3), depth_error(PIXELS, 1e-4)
    assert np.allclose(near, 10 * far)
    assert 0.5 < size_deg(near)[0, 0] < 2.0


def test_an_unknown_camera_costs_the_view_vectors() -> None:
    """Those of the sphere and of the pixel: on the axis the sphere's alone."""
    sphere = 0.5 * np.degrees(np.arctan(100.0 / 500.0))
    error = size_deg(unknown_camera_error(PIXELS, [SPHERE], (260.0, 110.0), 500.0))
    assert abs(error[60, 160] - sphere) < 0.01
    assert abs(error[60, 60] - np.sqrt(2.0) * sphere) < 0.01
