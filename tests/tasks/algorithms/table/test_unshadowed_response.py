"""Response to the lights that pass the object, of a table with a shadow and of glass that flashes on its own side."""

import numpy as np

from glint.tasks.algorithms.table.light_sectors import LIGHT_SECTORS, passing_sectors
from glint.tasks.algorithms.table.table_response import table_response
from glint.tasks.algorithms.table.unshadowed_response import unshadowed_response

SHAPE, CENTRE, RADIUS = (120, 160), (60.0, 80.0), 18.0


def scene(frames: int = 120) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frames (T, H, W) of a disc and its shadow under lights that go round, their sectors (T,), and the disc."""
    generator = np.random.default_rng(4)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    disc = np.hypot(rows - CENTRE[0], columns - CENTRE[1]) < RADIUS
    sectors = np.arange(frames) % LIGHT_SECTORS
    pictures = []
    for number, sector in enumerate(sectors):
        right, up = np.cos(2 * np.pi * sector / LIGHT_SECTORS), np.sin(2 * np.pi * sector / LIGHT_SECTORS)
        picture = np.full(SHAPE, 70.0 + 20.0 * np.cos(number / 7.0))
        shadow = np.hypot(rows - CENTRE[0] - 24 * up, columns - CENTRE[1] + 24 * right) < RADIUS
        picture[shadow & ~disc] *= 0.4
        picture[disc] = 50.0
        picture[np.hypot(rows - CENTRE[0] + 14 * up, columns - CENTRE[1] - 14 * right) < 3] = 255.0
        pictures.append(picture + generator.normal(0.0, 1.0, SHAPE))
    return np.clip(np.rint(pictures), 0, 255).astype(np.uint8), sectors, disc


def test_a_shadow_is_the_bare_table_and_glass_still_flashes() -> None:
    frames, sectors, disc = scene()
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    distance = np.hypot(rows - CENTRE[0], columns - CENTRE[1])
    shadowed, flashing = (distance > RADIUS + 4) & (distance < 36), (distance > 12) & (distance < 16)
    response = table_response(frames, np.ones(SHAPE, bool))
    unshadowed = unshadowed_response(response, frames, sectors, disc)
    assert np.median(response.deviation[shadowed]) > 1.5
    assert np.median(unshadowed.deviation[shadowed]) < 0.2
    assert np.median(unshadowed.flash[flashing]) > 2.0
    assert np.median(unshadowed.deviation[shadowed]) > -0.1
    # The largest flash is one of a light that reaches the pixel.
    passing = passing_sectors(disc, np.bincount(sectors))
    rows, columns = np.nonzero(distance < 36)
    assert passing[sectors[unshadowed.moment[rows, columns]], rows, columns].all()
    assert not passing[sectors[response.moment[rows, columns]], rows, columns].all()


def test_frames_of_unknown_lights_are_left_out() -> None:
    frames, sectors, disc = scene()
    response = table_response(frames, np.ones(SHAPE, bool))
    known = unshadowed_response(response, frames, sectors, disc)
    frames[5] = 255
    unknown = np.where(np.arange(len(sectors)) == 5, -1, sectors)
    assert np.abs(unshadowed_response(response, frames, unknown, disc).deviation - known.deviation).max() < 0.5
