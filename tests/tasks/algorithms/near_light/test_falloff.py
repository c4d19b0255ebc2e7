from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from glint.storage.footage.source import open_footage
from glint.storage.footage.writer import write_video
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.near_light.falloff import Falloff, measure_falloff
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.table_plane import TablePlane
from tests.tasks.algorithms.near_light.two_spheres import spiral

SPHERE, RADIUS = np.array([120.0, 10.0, 0.0]), 20.0
SIZE = 100.0
"""Of an object in pixels; the frame is four times as wide."""


def background(
    distance: float,
    *,
    room: float = 0.1,
    shadows: bool = True,
    drift: float = 0.2,
    gamma: float = 2.2,
    seed: int = 0,
    directions: np.ndarray | None = None,
    tilt: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, SphereLights, np.ndarray, float]:
    """Return levels (T, N), x and y (N,) of a matte cloth, the light's directions at the sphere, its centre and radius.

    directions: (128, 3) of the light from the reference point; a spiral by default. tilt: angle in degrees between the
    cloth's normal and the camera's axis.
    """
    generator = np.random.default_rng(seed)
    rows, columns = np.mgrid[-110:111:10.0, -200:201:10.0]
    x, y = columns.ravel(), rows.ravel()
    beside = np.hypot(x, y) > 60.0
    x, y = x[beside], y[beside]
    table = TablePlane.below(normal_of(tilt), SPHERE, RADIUS)
    positions = distance * (spiral(128, 60.0) if directions is None else directions)
    places = table.points(x, y)
    towards = positions[:, None] - places
    length = np.linalg.norm(towards, axis=-1)
    irradiance = np.maximum(towards @ table.normal, 0.0) / length * (distance / length) ** 2
    if shadows:
        top = SPHERE + (40.0 - RADIUS) * table.normal
        foot = top - 40.0 * positions / np.maximum(positions @ table.normal, 0.1 * distance)[:, None]
        irradiance[np.linalg.norm(places - foot[:, None], axis=-1) < 30.0] = 0.0
    albedo = generator.uniform(0.5, 1.0, x.size)
    exposure = 1.0 + drift * np.sin(np.arange(128) / 9.0)[:, None]
    levels = 70.0 * (exposure * albedo * (irradiance + room)) ** (1.0 / gamma) + generator.normal(
        0, 0.4, towards.shape[:2]
    )
    site = SphereLights(unit(positions - SPHERE), np.broadcast_to(SPHERE, positions.shape))
    return levels, x, y, site, SPHERE, RADIUS


def normal_of(tilt: float) -> np.ndarray:
    """Return the normal (3,) of a table whose angle to the camera's axis is `tilt` degrees."""
    return np.array([0.0, np.sin(np.radians(tilt)), np.cos(np.radians(tilt))])


@pytest.mark.parametrize(
    ("distance", "shadows"), [(500.0, True), (1000.0, True), (1000.0, False), (3000.0, True), (3000.0, False)]
)
def test_the_background_shows_a_near_light(distance: float, shadows: bool) -> None:
    found = measure_falloff(*background(distance, shadows=shadows, drift=0.2 if shadows else 0.0))
    assert found is not None
    assert abs(found.inverse_distance * distance - 1) < 0.3
    assert 0.2 < found.standard_deviation * distance < 0.5


@pytest.mark.parametrize("tilt", [30.0, 60.0, 75.0])
@pytest.mark.parametrize("distance", [500.0, 1500.0])
def test_the_table_may_be_seen_aslant(distance: float, tilt: float) -> None:
    found = measure_falloff(*background(distance, tilt=tilt, drift=0.0))
    assert found is not None
    assert abs(found.inverse_distance * distance - 1) < 0.3


@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_a_distant_light_is_proven_distant(tilt: float) -> None:
    found = measure_falloff(*background(1e6, tilt=tilt))
    assert found is not None and found.inverse_distance == 0.0
    assert found.standard_deviation < 0.01 / SIZE


def test_a_camera_without_gamma_is_within_the_error() -> None:
    found = measure_falloff(*background(1000.0, gamma=1.6))
    assert found is not None
    assert abs(found.inverse_distance - 1e-3) < 2.0 * found.standard_deviation


def test_a_bright_room_shows_nothing() -> None:
    assert measure_falloff(*background(1000.0, room=5.0)) is None


def test_a_black_cloth_shows_nothing() -> None:
    levels, x, y, site, centre, radius = background(1000.0)
    assert measure_falloff(0.05 * levels, x, y, site, centre, radius) is None


def test_a_dozen_photographs_show_nothing() -> None:
    levels, x, y, site, centre, radius = background(1000.0)
    assert (
        measure_falloff(levels[::10], x, y, SphereLights(site.lights[::10], site.positions[::10]), centre, radius)
        is None
    )


def test_rejected_frames_are_left_out() -> None:
    levels, x, y, site, centre, radius = background(1000.0)
    site.lights[::7], levels[::7] = np.nan, 200.0
    found = measure_falloff(levels, x, y, site, centre, radius)
    assert isinstance(found, Falloff)
    assert abs(found.inverse_distance * 1000.0 - 1) < 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_distance_is_that_from_the_reference_point(side: float) -> None:
    spread = spiral(128, 20.0) + np.array([0.9 * side, 0.0, 0.0])
    found = measure_falloff(*background(500.0, shadows=False, room=0.0, drift=0.0, directions=unit(spread)))
    assert found is not None
    assert abs(found.inverse_distance * 500.0 - 1) < 0.15


@pytest.mark.parametrize("light", [(0.0, 0.0, 1.0), (0.3, 0.0, 0.9)])
def test_a_light_that_stands_still_shows_nothing(light: tuple[float, float, float]) -> None:
    levels, x, y, site, centre, radius = background(1000.0)
    lights = np.broadcast_to(unit(np.array(light)), site.lights.shape)
    assert measure_falloff(levels, x, y, SphereLights(lights, site.positions), centre, radius) is None


def held(levels: np.ndarray, step: float) -> np.ndarray:
    """Return levels (T, N) as a codec shows them: each stays until it is off by more than `step`."""
    shown = levels.copy()
    for earlier, frame in pairwise(shown):
        stays = np.abs(frame - earlier) < step
        frame[stays] = earlier[stays]
    return shown


@pytest.mark.parametrize("step", [3.0, 5.0])
@pytest.mark.parametrize("distance", [1000.0, 1500.0])
def test_levels_that_a_codec_holds_are_allowed_for(distance: float, step: float) -> None:
    levels, x, y, site, centre, radius = background(distance, room=0.3, drift=0.0)
    found = measure_falloff(np.round(held(levels, step)), x, y, site, centre, radius)
    assert found is not None
    assert abs(found.inverse_distance * distance - 1) < 0.2


def coded(levels: np.ndarray, x: np.ndarray, y: np.ndarray, folder: Path, crf: int) -> np.ndarray:
    """Return levels (T, N) of blocks of 8 pixels at x, y (N,) as a video at a sixth of its speed shows them."""
    columns, rows = np.round((x - x.min()) / 10).astype(int), np.round((y.max() - y) / 10).astype(int)
    times = np.linspace(0, len(levels) - 1, 6 * len(levels))
    generator = np.random.default_rng(0)

    def pictures() -> Iterator[np.ndarray]:
        for time in times:
            earlier, share = int(time), time % 1.0
            level = (1.0 - share) * levels[earlier] + share * levels[min(earlier + 1, len(levels) - 1)]
            blocks = np.full((rows.max() + 1, columns.max() + 1), np.median(level))
            blocks[rows, columns] = level
            picture = np.kron(blocks, np.ones((8, 8)))
            yield np.clip(picture + generator.normal(0.0, 2.0, picture.shape), 0.0, 255.0).astype(np.uint8)

    width, height = 8 * (columns.max() + 1), 8 * (rows.max() + 1)
    write_video(folder / "table.mp4", pictures(), width, height, 30, crf)
    wanted = np.searchsorted(times, np.arange(len(levels)) - 1e-9)
    with open_footage(folder / "table.mp4") as footage:
        frames = [frame for number, frame in enumerate(footage.frames()) if number in set(wanted.tolist())]
    blocks = np.stack(frames).reshape(len(levels), height // 8, 8, width // 8, 8).mean(axis=(2, 4))
    return np.round(blocks[:, rows, columns])


@pytest.mark.parametrize(("distance", "crf"), [(1000.0, 30), (2500.0, 34)])
def test_levels_that_a_video_codec_holds_back_are_allowed_for(tmp_path: Path, distance: float, crf: int) -> None:
    levels, x, y, site, centre, radius = background(distance, room=0.3, drift=0.0)
    found = measure_falloff(coded(levels, x, y, tmp_path, crf), x, y, site, centre, radius)
    assert found is not None
    assert abs(found.inverse_distance * distance - 1) < 0.35
    assert abs(found.inverse_distance * distance - 1) < found.standard_deviation * distance


def plain(distance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, SphereLights, np.ndarray, float]:
    """Return the same as `background`, of a dark cloth without texture, shadows or noise."""
    levels, x, y, site, centre, radius = background(distance, room=0.2, shadows=False, drift=0.0)
    albedo = np.median(levels, axis=0)
    return 45.0 * levels / albedo, x, y, site, centre, radius


def test_a_plain_table_shows_a_near_light_in_few_of_its_levels() -> None:
    levels, x, y, site, centre, radius = plain(10000.0)
    shown = np.round(levels)
    assert (shown == np.median(shown, axis=1, keepdims=True)).mean() > 0.5
    found = measure_falloff(shown, x, y, site, centre, radius)
    assert found is not None
    assert abs(found.inverse_distance * 10000.0 - 1) < 0.3


@pytest.mark.parametrize("distance", [2000.0, 1e6])
def test_what_a_codec_may_hide_is_not_known(distance: float) -> None:
    levels, x, y, site, centre, radius = plain(distance)
    flat = np.repeat(np.median(levels, axis=1, keepdims=True), levels.shape[1], axis=1)
    found = measure_falloff(np.round(held(flat, 3.0)), x, y, site, centre, radius)
    assert found is not None and found.inverse_distance == 0.0
    assert found.standard_deviation > 0.5 / 2000.0


@pytest.mark.parametrize("turns", [0.7, 1.0])
def test_a_drifting_exposure_does_not_hide_the_room(turns: float) -> None:
    steady, x, y, site, centre, radius = background(600.0, room=0.5, drift=0.0)
    drift = 1.0 + 0.2 * np.sin(np.linspace(0.0, 2.0 * np.pi * turns, len(steady)))
    drifting = steady * drift[:, None] ** (1.0 / 2.2)
    found = measure_falloff(drifting, x, y, site, centre, radius)
    assert found is not None
    assert abs(found.inverse_distance * 600.0 - 1) < 0.2
