from collections.abc import Sequence

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.triangulation import LightDistance, rotated, triangulate
from tests.tasks.algorithms.near_light.two_spheres import LEFT, MIDDLE, RIGHT, light_positions, shifted, sphere_normals


def sites(
    positions: np.ndarray, noise: float = 0.001, spheres: Sequence[Sphere] = (LEFT, RIGHT), seed: int = 2
) -> list[SphereLights]:
    errors = np.random.default_rng(seed).normal(0, noise, (len(spheres), len(positions), 3))
    return [
        SphereLights.of(unit(sphere_normals(positions, sphere) + error), sphere, MIDDLE, None)
        for sphere, error in zip(spheres, errors, strict=True)
    ]


def measured(positions: np.ndarray, noise: float = 0.001) -> LightDistance:
    found = triangulate(sites(positions, noise))
    assert found is not None
    return found


@pytest.mark.parametrize("distance", [700.0, 1200.0, 4000.0])
def test_two_spheres_measure_the_lights_distance(distance: float) -> None:
    found = measured(light_positions(distance))
    assert not found.varies
    assert np.abs(found.inverse_distance * distance - 1).max() < 0.02


def test_a_distance_that_varies_is_followed() -> None:
    distance = 1000.0 * (1.0 + 0.2 * np.sin(np.arange(800) / 60))
    positions = light_positions(distance, 800)
    found = measured(positions, 0.003)
    assert found.varies
    assert np.percentile(np.abs(found.inverse_distance * distance - 1), 90) < 0.04


def test_noise_is_no_varying_distance() -> None:
    assert not measured(light_positions(1000.0, 800), 0.005).varies


def test_a_wrong_highlight_does_not_bend_the_path() -> None:
    positions = light_positions(1000.0, 600)
    pair = sites(positions)
    pair[0].lights[100:110] = (0.6, 0.0, 0.8)
    found = triangulate(pair)
    assert found is not None
    assert np.abs(found.inverse_distance * 1000.0 - 1).max() < 0.05


def test_errors_of_the_spheres_centres_are_measured_with_it() -> None:
    positions = light_positions(3000.0)
    shift = np.array([0.005, -0.004])
    pair = [
        SphereLights.of(shifted(sphere_normals(positions, LEFT), *shift), LEFT, MIDDLE, None),
        SphereLights.of(sphere_normals(positions, RIGHT), RIGHT, MIDDLE, None),
    ]
    found, by_right = triangulate(pair), triangulate(pair, np.array([0.0, 1.0]))
    assert found is not None and by_right is not None
    assert np.abs(found.inverse_distance * 3000.0 - 1).max() < 0.05
    assert np.allclose(found.rotations[0] - found.rotations[1], shift, atol=5e-4)
    assert np.allclose(found.rotations.sum(axis=0), 0.0, atol=1e-6)
    assert np.allclose(by_right.rotations, np.stack([shift, np.zeros(2)]), atol=5e-4)


def test_spheres_agree_at_the_reference_point() -> None:
    positions = light_positions(900.0)
    pair = sites(positions, 0.0)
    found = triangulate(pair)
    assert found is not None
    truth = unit(positions - (MIDDLE[0], -MIDDLE[1], 0.0))
    for site, rotation in zip(pair, found.rotations, strict=True):
        assert np.median(angles(site.lights, truth)) > 5.0
        at_reference = site.at_reference(found.inverse_distance)
        assert np.percentile(angles(at_reference, truth), 95) < 0.2
        assert np.median(angles(rotated(at_reference, rotation), at_reference)) < 0.1


@pytest.mark.parametrize("missing", [[], [0, 2], [0, 1, 2]])
def test_three_spheres_are_used_together(missing: list[int]) -> None:
    """Spheres lose frames of their own, in which the others show the light."""
    positions = light_positions(1500.0)
    third = Sphere(250.0, 300.0, 28.0)
    all_sites = sites(positions, spheres=(LEFT, third, RIGHT))
    for sphere in missing:
        all_sites[sphere].lights[7 * sphere] = np.nan
        all_sites[sphere].positions[7 * sphere] = np.nan
    found = triangulate(all_sites)
    assert found is not None
    assert np.abs(found.inverse_distance * 1500.0 - 1).max() < 0.02


def test_a_distant_light_gives_no_distance() -> None:
    assert triangulate(sites(light_positions(1e7), 0.002)) is None


def test_one_sphere_or_few_shared_frames_give_no_distance() -> None:
    positions = light_positions(1200.0)
    assert triangulate(sites(positions, spheres=(LEFT,))) is None
    assert triangulate(sites(positions[:5])) is None
    disjoint = sites(positions)
    disjoint[0].lights[::2], disjoint[1].lights[1::2] = np.nan, np.nan
    assert triangulate(disjoint) is None


def test_two_spheres_at_one_place_give_no_distance() -> None:
    assert triangulate(sites(light_positions(1200.0), noise=0.0, spheres=(LEFT, LEFT))) is None
