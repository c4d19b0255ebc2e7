import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from tests.tasks.algorithms.near_light.two_spheres import (
    LEFT,
    MIDDLE,
    RIGHT,
    light_positions,
    shifted,
    sphere_normals,
    sphere_normals_in_perspective,
)

PAIR = (LEFT, RIGHT)


def noisy(values: np.ndarray, seed: int) -> np.ndarray:
    return np.asarray(unit(values + np.random.default_rng(seed).normal(0, 0.002, values.shape)))


@pytest.mark.parametrize("focal", [450.0, 900.0, 2500.0])
@pytest.mark.parametrize("distance", [1000.0, 1e6])
def test_two_spheres_show_a_near_camera(focal: float, distance: float) -> None:
    """Under a near light as well, whose parallax is no rotation."""
    positions = light_positions(distance)
    shown = [noisy(sphere_normals_in_perspective(positions, each, MIDDLE, focal), 3) for each in PAIR]
    found = focal_length_of_parallax(shown, PAIR, MIDDLE)
    assert found is not None
    assert 1 / 1.25 < found / focal < 1.25


@pytest.mark.parametrize("distance", [1000.0, 1e6])
def test_two_spheres_show_a_distant_camera(distance: float) -> None:
    positions = light_positions(distance)
    shown = [noisy(shifted(sphere_normals(positions, each), 0.008 * (each is LEFT)), 4) for each in PAIR]
    assert focal_length_of_parallax(shown, PAIR, MIDDLE) == np.inf


def test_a_wrong_sphere_is_no_near_camera() -> None:
    positions = light_positions(1e6)
    shown = [shifted(sphere_normals(positions, LEFT), 0.0, 0.1), sphere_normals(positions, RIGHT)]
    assert focal_length_of_parallax(shown, PAIR, MIDDLE) is None


def test_one_sphere_shows_nothing() -> None:
    assert focal_length_of_parallax([sphere_normals(light_positions(1e6), LEFT)], (LEFT,), MIDDLE) is None
