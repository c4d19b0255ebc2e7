"""Shadows and caustics on the table: where they fall, and how much light they take and bring."""

import numpy as np
import pytest

from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.environment import Environment
from glint.tasks.algorithms.simulation.ray_tracing import Paths, Scene
from glint.tasks.algorithms.simulation.renderer import prepare_renderer
from glint.tasks.algorithms.simulation.solids import CHROME, GLASS, MATTE, sphere
from glint.tasks.algorithms.simulation.table_light import TableLight

RADIUS, HEIGHT, HALF = 15.0, 40.0, 70
TABLE = TablePlane(np.array([0.0, 0.0, 1.0]), -HEIGHT)
REFLECTANCE = 0.35
LIGHT_RADIUS = np.radians(1.0)
SLANTING, ZENITH = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)]), np.array([0.0, 0.0, 1.0])
Y, X = np.mgrid[HALF : -HALF - 1 : -1, -HALF : HALF + 1].astype(float)


def prepared(scene: Scene, paths: Paths, room: Environment) -> TableLight:
    """Return what the scene's solids do to the light of its table."""
    _, reflectance = room.radiance(paths.origin, paths.direction)
    return TableLight.prepare(scene, paths, room.table, reflectance, X.shape, LIGHT_RADIUS)


def change_of(material: int, light: np.ndarray, distance: float | None = None) -> np.ndarray:
    """Return the change of the table's light by a sphere above the frame's centre."""
    scene = Scene([sphere(np.zeros(3), RADIUS, material)])
    room = Environment.random(TABLE, np.random.default_rng(0), contrast=0.0)
    paths = scene.trace(X, Y, 1, np.random.default_rng(0))
    return prepared(scene, paths, room).change(light, distance)


@pytest.mark.parametrize("material", [MATTE, CHROME])
def test_an_opaque_sphere_throws_its_shadow_away_from_the_light(material: int) -> None:
    change = change_of(material, SLANTING)
    # The shadow of a light at 45 degrees lies as far to the side as the sphere is high; it is an ellipse.
    distance = np.hypot((X + HEIGHT) / np.sqrt(2.0), Y)
    shadow = (distance < RADIUS - 4.0) & (np.hypot(X, Y) > RADIUS + 2.0)
    full = -REFLECTANCE * SLANTING[2]
    assert np.median(change[shadow]) == pytest.approx(full, rel=0.05)
    # The lit side, which receives what chrome mirrors down, is hardly changed.
    assert np.abs(change[(X > RADIUS + 5.0)]).max() < 0.5 * abs(full)
    if material == MATTE:
        assert np.abs(change[(distance > RADIUS + 6.0) & (np.hypot(X, Y) > RADIUS + 2.0)]).max() < 0.01


@pytest.mark.parametrize(("distance", "half_width"), [(None, RADIUS), (200.0, 19.3)])
def test_a_near_light_throws_a_larger_shadow(distance: float | None, half_width: float) -> None:
    # The ray through the sphere's centre ends 57 pixels behind it; the cone of the light about the sphere widens.
    across = change_of(MATTE, SLANTING, distance)[:, HALF - round(HEIGHT)]
    assert (across < 0.5 * across.min()).sum() / 2 == pytest.approx(half_width, abs=1.5)


def test_glass_gathers_light_in_its_shadow_and_keeps_nearly_all_of_it() -> None:
    scene = Scene([sphere(np.zeros(3), RADIUS, GLASS)])
    # The focus of a ball of this glass lies 1.5 radii behind its centre.
    focal_plane = TablePlane(ZENITH, -1.5 * RADIUS)
    room = Environment.random(focal_plane, np.random.default_rng(0), contrast=0.0)
    # The camera sees the bare table, as though the sphere were not there.
    paths = Scene([sphere(np.array([0.0, 0.0, 1e4]), 0.01, MATTE)]).trace(X, Y, 1, np.random.default_rng(0))
    table_light = prepared(scene, paths, room)
    change = table_light.change(ZENITH, None)
    blocked = np.pi * RADIUS**2 * REFLECTANCE
    # A ball of glass mirrors about a tenth of the light away, part of it to the sides within the frame.
    assert -0.25 * blocked < change.sum() < 0.01 * blocked
    assert change.max() > 2.0 * REFLECTANCE
    assert np.hypot(X, Y)[np.unravel_index(change.argmax(), change.shape)] < 6.0
    assert change[np.abs(np.hypot(X, Y) - 0.9 * RADIUS) < 1.0].mean() < -0.3 * REFLECTANCE


def test_a_light_below_the_table_changes_nothing_and_a_rendered_shadow_is_dark() -> None:
    scene = Scene([sphere(np.zeros(3), RADIUS, CHROME)])
    room = Environment.random(TABLE, np.random.default_rng(0), contrast=0.0)
    paths = scene.trace(X, Y, 1, np.random.default_rng(0))
    table_light = prepared(scene, paths, room)
    assert not table_light.change(-ZENITH, None).any()
    bare, shaded = (prepare_renderer(paths, room, X.shape, LIGHT_RADIUS, part) for part in (None, scene))
    dark, lit = bare.render(np.full(3, np.nan)), bare.render(SLANTING)
    row, column = HALF, HALF - round(HEIGHT)
    assert lit[row, column] > 1.2 * dark[row, column]
    assert shaded.render(SLANTING)[row, column] == pytest.approx(dark[row, column], rel=0.1)
