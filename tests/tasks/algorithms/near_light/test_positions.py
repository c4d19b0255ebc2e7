import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit
from glint.tasks.algorithms.near_light.positions import NearLight
from tests.tasks.algorithms.near_light.two_spheres import MIDDLE, half_vectors_at, light_positions


def near_light(positions: np.ndarray) -> NearLight:
    relative = positions - (MIDDLE[0], -MIDDLE[1], 0.0)
    half_vectors = half_vectors_of(unit(relative)).astype(np.float32)
    return NearLight(*MIDDLE, half_vectors, (1.0 / np.linalg.norm(relative, axis=1)).astype(np.float32))


def test_half_vectors_are_corrected_for_the_pixel() -> None:
    positions = light_positions(1200.0)
    truth = half_vectors_at(positions, 140.0, 90.0)
    light = near_light(positions)
    place = np.full(len(positions), 140.0), np.full(len(positions), 90.0)
    assert np.median(angles(light.half_vectors, truth)) > 2.0
    assert angles(light.half_vectors_at(light.half_vectors, *place), truth).max() < 0.01


def test_a_varying_distance_is_that_of_the_nearest_lights() -> None:
    positions = light_positions(1000.0 + 300.0 * np.sin(np.arange(800) / 80), 800)
    truth = half_vectors_at(positions, 140.0, 90.0)
    light = near_light(positions)
    between = unit(light.half_vectors[:-1] + light.half_vectors[1:])
    place = np.full(len(between), 140.0), np.full(len(between), 90.0)
    corrected = light.half_vectors_at(between, *place)
    assert np.percentile(angles(corrected, unit(truth[:-1] + truth[1:])), 95) < 0.1


def test_what_is_unknown_stays_unknown() -> None:
    light = near_light(light_positions(900.0))
    assert np.isnan(light.half_vectors_at(np.full((2, 3), np.nan), np.zeros(2), np.zeros(2))).all()
