"""Sectors of the light, and which of them pass an object."""

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.table.light_sectors import LIGHT_SECTORS, MIN_FRAMES_SHARE, passing_sectors, sectors_of
from tests.tasks.algorithms.lighting.chrome_sphere import light_direction, sphere_frame

SPHERE = Sphere(30.0, 30.0, 24.0)
FRAMES = np.full(LIGHT_SECTORS, 10)
RIGHT, UP, LEFT, DOWN = (quarter * LIGHT_SECTORS // 4 for quarter in range(4))


def disc(radius: float = 20.0) -> np.ndarray:
    rows, columns = np.mgrid[:120, :160]
    return np.hypot(columns - 80, rows - 60) < radius


def test_the_sector_is_that_of_the_light_which_the_sphere_shows() -> None:
    azimuths = np.arange(0.0, 360.0, 15.0) + 3.0
    frames = np.stack([sphere_frame(SPHERE, [light_direction(azimuth, 50.0)], (61, 61)) for azimuth in azimuths])
    assert np.array_equal(sectors_of(frames, [SPHERE]), np.round(azimuths * LIGHT_SECTORS / 360.0) % LIGHT_SECTORS)


def test_frames_without_a_light_or_a_sphere_have_none() -> None:
    frames = np.stack(
        [sphere_frame(SPHERE, [light_direction(40.0, 50.0)] * (number > 2), (61, 61)) for number in range(9)]
    )
    sectors = sectors_of(frames, [SPHERE])
    assert (sectors[:3] == -1).all() and (sectors[3:] >= 0).all()
    assert (sectors_of(frames, []) == -1).all()
    assert (sectors_of(np.full_like(frames, 60), [SPHERE]) == -1).all()


def test_the_sphere_that_shows_the_light_most_often_counts() -> None:
    right, up = (sphere_frame(SPHERE, [light_direction(azimuth, 50.0)], (61, 61)) for azimuth in (0.0, 90.0))
    dark = sphere_frame(SPHERE, [], (61, 61))
    # The first sphere shows a light in every third frame, the second one in all others.
    frames = np.stack([np.hstack([dark, up] if number % 3 else [right, dark]) for number in range(9)])
    spheres = [SPHERE, Sphere(SPHERE.x + 61.0, SPHERE.y, SPHERE.radius)]
    for order in (spheres, spheres[::-1]):
        assert np.array_equal(sectors_of(frames, order), np.where(np.arange(9) % 3, UP, -1))


@pytest.mark.parametrize(
    ("row", "column", "blocked"), [(60, 120, LEFT), (60, 40, RIGHT), (20, 80, DOWN), (100, 80, UP)]
)
def test_the_table_beside_an_object_is_reached_by_all_lights_but_those_beyond_it(
    row: int, column: int, blocked: int
) -> None:
    passing = passing_sectors(disc(), FRAMES)[:, row, column]
    assert not passing[blocked]
    assert passing[(blocked + np.arange(3, LIGHT_SECTORS - 2)) % LIGHT_SECTORS].all()


def test_a_pixel_within_the_object_keeps_the_lights_of_its_own_side() -> None:
    passing = passing_sectors(disc(), FRAMES)[:, 60, 94]
    assert passing[RIGHT] and not passing[LEFT]
    assert passing.sum() >= MIN_FRAMES_SHARE * LIGHT_SECTORS


def test_a_pixel_is_no_obstacle_to_its_own_light_and_neither_is_a_single_other_one() -> None:
    bar = np.zeros((120, 160), bool)
    bar[40:80, 80:82] = True
    right = passing_sectors(bar, FRAMES)[RIGHT, 60]
    assert right[80:].all() and not right[:80].any()


def test_sectors_without_frames_pass_nowhere() -> None:
    frames = FRAMES.copy()
    frames[[RIGHT, UP]] = 0
    passing = passing_sectors(disc(), frames)
    assert not passing[[RIGHT, UP]].any()
    assert (np.einsum("s,shw->hw", frames, passing) >= MIN_FRAMES_SHARE * frames.sum()).all()
