import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit
from glint.tasks.algorithms.lighting.near_light import find_near_lamp, lamp_beside
from glint.tasks.algorithms.lighting.spheres import Sphere

LEFT, RIGHT = Sphere(40.0, 120.0, 30.0), Sphere(440.0, 160.0, 30.0)


def lamps(distance: float, count: int = 400) -> np.ndarray:
    """Places (N, 3) of a lamp so far from the middle between the spheres, in frame pixels with y up."""
    directions = unit(np.random.default_rng(1).normal(0, 0.6, (count, 3)) * (1, 1, 0) + (0, 0, 1))
    return np.array([240.0, -140.0, 0.0]) + distance * directions


def seen(places: np.ndarray, x: float, y: float) -> np.ndarray:
    """The half vectors (N, 3) that the pixel (x, y) of the frame has of lamps at `places`."""
    return half_vectors_of(unit(places - (x, -y, 0.0)))


def on_ball(places: np.ndarray, sphere: Sphere) -> np.ndarray:
    """The normals (N, 3) of a ball where it mirrors lamps at `places`."""
    normal = seen(places, sphere.x, sphere.y)
    for _ in range(5):
        normal = half_vectors_of(unit(places - (sphere.x, -sphere.y, 0.0) - sphere.radius * normal))
    return normal


@pytest.mark.parametrize("distance", [1200.0, 4000.0])
def test_two_balls_tell_how_far_the_lamp_is(distance: float) -> None:
    places = lamps(distance)
    noise = np.random.default_rng(2).normal(0, 0.001, (2, len(places), 3))
    pair = [unit(on_ball(places, each) + off) for each, off in zip((LEFT, RIGHT), noise, strict=True)]
    found = find_near_lamp(pair, (LEFT, RIGHT))
    assert found is not None
    assert abs(found.distance / distance - 1) < 0.1


def test_balls_whose_centres_are_a_little_off_tell_it_too() -> None:
    places = lamps(3000.0)
    shift = np.array([0.005, -0.004, 0.0])
    found = find_near_lamp([unit(on_ball(places, LEFT) + shift), on_ball(places, RIGHT)], (LEFT, RIGHT))
    assert found is not None
    assert abs(found.distance / 3000.0 - 1) < 0.1


def test_a_far_lamp_is_far() -> None:
    noise = np.random.default_rng(2).normal(0, 0.002, (2, 400, 3))
    places = lamps(1e7)
    assert find_near_lamp([unit(on_ball(places, LEFT) + off) for off in noise], (LEFT, RIGHT)) is None


def test_one_ball_or_few_frames_tell_nothing() -> None:
    places = lamps(1200.0)
    assert find_near_lamp([on_ball(places, LEFT)], (LEFT,)) is None
    few = [on_ball(places[:5], each) for each in (LEFT, RIGHT)]
    assert find_near_lamp(few, (LEFT, RIGHT)) is None
    apart = [on_ball(places, each) for each in (LEFT, RIGHT)]
    apart[0][::2], apart[1][1::2] = np.nan, np.nan
    assert find_near_lamp(apart, (LEFT, RIGHT)) is None


def test_half_vectors_are_turned_to_the_pixel() -> None:
    places = lamps(1200.0)
    truth = seen(places, 200.0, 90.0)
    read = on_ball(places, RIGHT)
    turned = lamp_beside((RIGHT,), 1250.0).seen_from(read, np.full(len(places), 200.0), np.full(len(places), 90.0))
    assert np.median(angles(read, truth)) > 3.0
    assert np.median(angles(turned, truth)) < 0.5


def test_what_is_missing_stays_missing() -> None:
    turned = lamp_beside((LEFT, RIGHT), 900.0).seen_from(np.full((2, 3), np.nan), np.zeros(2), np.zeros(2))
    assert np.isnan(turned).all()
