from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import (
    HighlightShapes,
    circle_of_highlights,
    circle_of_shapes,
    expected_moments,
)
from tests.tasks.algorithms.sphere_checks.mirrored_lamp import LAMP_RADIUS_DEG, lamps, mirrored_lamp

TRUTH = Sphere(58.3, 60.8, 30.4)


@pytest.fixture(scope="module")
def frames() -> np.ndarray:
    return mirrored_lamp(TRUTH, lamps(120))


@pytest.mark.parametrize("right, down, ratio", [(0.0, 0.0, 1.0), (2.4, -0.9, 0.92), (-3.6, 2.7, 1.15)])
def test_a_circle_beside_the_sphere_does_not_mislead(
    frames: np.ndarray, right: float, down: float, ratio: float
) -> None:
    wrong = Sphere(TRUTH.x + right, TRUTH.y + down, ratio * TRUTH.radius)
    shapes = circle_of_highlights(frames, wrong)
    assert shapes is not None
    error = np.hypot(shapes.x - TRUTH.x, shapes.y - TRUTH.y)
    assert error < 0.02 * TRUTH.radius
    assert shapes.sd < 0.02 * TRUTH.radius
    # An upper bound, which the blur of pixels alone hardly widens.
    assert 0.97 * TRUTH.radius < shapes.max_radius < 1.1 * TRUTH.radius


def test_blur_widens_the_bound_of_the_radius_and_leaves_the_centre() -> None:
    directions = lamps(120)
    normals = directions + np.array([0.0, 0.0, 1.0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    x, y = TRUTH.x + TRUTH.radius * normals[:, 0], TRUTH.y - TRUTH.radius * normals[:, 1]
    size = (0.5 * TRUTH.radius * np.radians(LAMP_RADIUS_DEG)) ** 2 / 4.0
    moments = expected_moments(x, y, TRUTH, size)
    sharp = circle_of_shapes(HighlightShapes(x, y, moments), TRUTH)
    blurred = circle_of_shapes(HighlightShapes(x, y, moments + size * np.array([1.0, 0.0, 1.0])), TRUTH)
    assert sharp is not None and blurred is not None
    assert sharp.max_radius == pytest.approx(TRUTH.radius, rel=0.01)
    assert blurred.max_radius > 1.15 * TRUTH.radius
    for shapes in (sharp, blurred):
        assert np.hypot(shapes.x - TRUTH.x, shapes.y - TRUTH.y) < 0.01 * TRUTH.radius


@pytest.mark.parametrize("upward", [(0.0, 1.0, 0.0), (0.1, 1.0, 0.3), (1.0, 0.4, 0.0), (0.0, 0.7, 0.7)])
def test_an_oblong_lamp_says_nothing(upward: tuple[float, float, float]) -> None:
    lamp = mirrored_lamp(TRUTH, lamps(120), width_ratio=1.3, upward=upward)
    assert circle_of_highlights(lamp, TRUTH) is None


def test_half_a_sweep_says_how_little_it_knows(frames: np.ndarray) -> None:
    few = frames[lamps(120)[:, 0] > 0.4]
    shapes = circle_of_highlights(few, TRUTH)
    whole = circle_of_highlights(frames, TRUTH)
    assert whole is not None
    assert shapes is None or shapes.sd > 1.5 * whole.sd


def test_highlights_on_one_side_alone_say_nothing() -> None:
    turns, distances = np.random.default_rng(0).uniform((0.1, 5.0), (0.9, 17.0), (40, 2)).T
    x, y = TRUTH.x + distances * np.cos(turns), TRUTH.y + distances * np.sin(turns)
    assert circle_of_shapes(HighlightShapes(x, y, expected_moments(x, y, TRUTH, 4.0)), TRUTH) is None


def test_few_frames_say_nothing(frames: np.ndarray) -> None:
    assert circle_of_highlights(frames[:20], TRUTH) is None


def test_a_sphere_without_light_says_nothing(frames: np.ndarray) -> None:
    assert circle_of_highlights(np.full_like(frames, 60), TRUTH) is None


def test_a_camera_sees_the_centre_likewise(frames: np.ndarray) -> None:
    camera = np.array([[4000.0, 0.0, 60.0], [0.0, 4000.0, 60.0], [0.0, 0.0, 1.0]])
    shapes = circle_of_highlights(frames, replace(TRUTH, x=TRUTH.x + 2.0), camera=camera)
    assert shapes is not None
    assert np.hypot(shapes.x - TRUTH.x, shapes.y - TRUTH.y) < 0.03 * TRUTH.radius
