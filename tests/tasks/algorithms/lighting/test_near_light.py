import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit
from glint.tasks.algorithms.lighting.near_light import PointLight, estimate_point_light
from glint.tasks.algorithms.lighting.spheres import Sphere

LEFT, RIGHT = Sphere(40.0, 120.0, 30.0), Sphere(440.0, 160.0, 30.0)


def light_positions(distance: float, count: int = 400) -> np.ndarray:
    """Return positions (N, 3) of a light at a distance from the middle between the spheres, frame pixels, y up."""
    directions = unit(np.random.default_rng(1).normal(0, 0.6, (count, 3)) * (1, 1, 0) + (0, 0, 1))
    return np.array([240.0, -140.0, 0.0]) + distance * directions


def half_vectors_at(positions: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the half vectors (N, 3) of lights at `positions`, at the pixel (x, y) of the frame."""
    return half_vectors_of(unit(positions - (x, -y, 0.0)))


def sphere_normals(positions: np.ndarray, sphere: Sphere) -> np.ndarray:
    """Return the normals (N, 3) of a sphere where it reflects lights at `positions`."""
    normal = half_vectors_at(positions, sphere.x, sphere.y)
    for _ in range(5):
        normal = half_vectors_of(unit(positions - (sphere.x, -sphere.y, 0.0) - sphere.radius * normal))
    return normal


@pytest.mark.parametrize("distance", [1200.0, 4000.0])
def test_two_spheres_measure_the_lights_distance(distance: float) -> None:
    positions = light_positions(distance)
    noise = np.random.default_rng(2).normal(0, 0.001, (2, len(positions), 3))
    pair = [unit(sphere_normals(positions, sphere) + error) for sphere, error in zip((LEFT, RIGHT), noise, strict=True)]
    light = estimate_point_light(pair, (LEFT, RIGHT))
    assert light is not None
    assert abs(light.distance / distance - 1) < 0.1


def test_errors_of_the_spheres_centres_are_absorbed() -> None:
    positions = light_positions(3000.0)
    shift = np.array([0.005, -0.004, 0.0])
    light = estimate_point_light(
        [unit(sphere_normals(positions, LEFT) + shift), sphere_normals(positions, RIGHT)], (LEFT, RIGHT)
    )
    assert light is not None
    assert abs(light.distance / 3000.0 - 1) < 0.1


def test_a_distant_light_gives_no_point_light() -> None:
    noise = np.random.default_rng(2).normal(0, 0.002, (2, 400, 3))
    positions = light_positions(1e7)
    assert (
        estimate_point_light([unit(sphere_normals(positions, LEFT) + error) for error in noise], (LEFT, RIGHT)) is None
    )


def test_one_sphere_or_few_shared_frames_give_no_point_light() -> None:
    positions = light_positions(1200.0)
    assert estimate_point_light([sphere_normals(positions, LEFT)], (LEFT,)) is None
    few = [sphere_normals(positions[:5], sphere) for sphere in (LEFT, RIGHT)]
    assert estimate_point_light(few, (LEFT, RIGHT)) is None
    disjoint = [sphere_normals(positions, sphere) for sphere in (LEFT, RIGHT)]
    disjoint[0][::2], disjoint[1][1::2] = np.nan, np.nan
    assert estimate_point_light(disjoint, (LEFT, RIGHT)) is None


def test_half_vectors_are_corrected_for_the_pixel() -> None:
    positions = light_positions(1200.0)
    truth = half_vectors_at(positions, 200.0, 90.0)
    measured = sphere_normals(positions, RIGHT)
    corrected = PointLight.from_distance((RIGHT,), 1250.0).half_vectors_at(
        measured, np.full(len(positions), 200.0), np.full(len(positions), 90.0)
    )
    assert np.median(angles(measured, truth)) > 3.0
    assert np.median(angles(corrected, truth)) < 0.5


def test_rejected_frames_stay_rejected() -> None:
    corrected = PointLight.from_distance((LEFT, RIGHT), 900.0).half_vectors_at(
        np.full((2, 3), np.nan), np.zeros(2), np.zeros(2)
    )
    assert np.isnan(corrected).all()
