import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.near_light.table_plane import TablePlane, shadow_share, table_normal
from tests.tasks.algorithms.near_light.two_spheres import spiral

CENTRE, RADIUS = np.array([50.0, -20.0, 0.0]), 15.0


def levels_of(normal: np.ndarray, lights: np.ndarray, room: float = 0.2) -> np.ndarray:
    """Return levels (T, N) of a matte plane under distant lights (T, 3), with a shadow that wanders over it."""
    generator = np.random.default_rng(0)
    irradiance = np.repeat(np.maximum(lights @ normal, 0.0)[:, None], 200, axis=1)
    irradiance[(np.arange(200) // 20)[None] == (np.arange(len(lights)) % 10)[:, None]] = 0.0
    albedo = generator.uniform(0.5, 1.0, 200)
    return 100.0 * (albedo * (irradiance + room)) ** (1.0 / 2.2) + generator.normal(0.0, 0.5, irradiance.shape)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.8, 0.6), (0.3, 0.9, 0.3)])
def test_the_normal_is_the_gradient_of_the_brightness(normal: tuple[float, float, float]) -> None:
    true, lights = unit(np.array(normal)), spiral(300, 75.0)
    assert angles(table_normal(levels_of(true, lights), lights), true) < 2.0


def test_a_table_that_is_hardly_seen_keeps_a_normal_towards_the_camera() -> None:
    lights = spiral(300, 75.0)
    assert table_normal(levels_of(np.array([0.0, 1.0, -0.3]), lights), lights)[2] > 0.09


def test_the_darkest_shadow_bounds_the_light_of_the_room() -> None:
    lights = spiral(300, 40.0)
    share = shadow_share(levels_of(np.array([0.0, 0.0, 1.0]), lights, room=0.25))
    assert 0.18 < share < 0.24


def test_noise_does_not_pass_for_a_darker_shadow() -> None:
    levels = levels_of(np.array([0.0, 0.0, 1.0]), spiral(300, 40.0), room=0.25)
    noisy = levels + np.random.default_rng(1).normal(0.0, 3.0, levels.shape)
    assert shadow_share(noisy) == pytest.approx(shadow_share(levels), rel=0.07)


def test_a_light_that_is_off_for_a_while_shows_the_light_of_the_room() -> None:
    lights = spiral(300, 40.0)
    levels = levels_of(np.array([0.0, 0.0, 1.0]), lights, room=0.25)
    levels[:6] = (0.1 / 0.25) ** (1.0 / 2.2) * levels.min(axis=0)
    assert 0.06 < shadow_share(levels) < 0.1


def test_the_plane_touches_the_sphere_from_below() -> None:
    normal = unit(np.array([0.1, 0.7, 0.6]))
    plane = TablePlane.below(normal, CENTRE, RADIUS)
    touching = CENTRE - RADIUS * normal
    np.testing.assert_allclose(plane.points(touching[:1], touching[1:2])[0], touching, atol=1e-9)


def test_levels_of_a_near_light_fall_with_the_square_of_the_distance() -> None:
    plane = TablePlane.below(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0)
    points, light = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    below, beside = plane.log_levels(points, light, 0.01, 0.0)[0]
    assert below - beside == pytest.approx(1.5 * np.log(2.0) / 2.2)
    assert np.ptp(plane.log_levels(points, light, 0.01, 0.9)) < 0.2 * (below - beside)
