import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.near_light.distance_by_wall import (
    DistanceChange,
    WallNormals,
    distance_by_wall,
    moved_by_light,
    turned_by_light,
    wall_normals,
)

RADIUS, SIDE = 60.0, 200.0
"""Of an upright cylinder, and its axis' distance from the sphere, in pixels."""
SPHERE_SD = np.radians(0.5)
UPWARD = np.array([0.0, 0.0, 1.0])


def cylinder(
    inverse: float = 0.0,
    *,
    depth: float = 1.0,
    sphere_error: float = 0.0,
    noise_deg: float = 1.0,
    focal: float | None = None,
    slope: float = 0.0,
) -> WallNormals:
    """Return the normals of a cylinder as lights show them that are nearer than supposed.

    inverse: of the light's distance, taken for 0, 1/pixels. depth: of the body over its width. sphere_error: added to
    n_x of all half vectors. focal: of a perspective camera above the sphere, pixels. slope: of the wall, as of a cone.
    """
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-0.8 * RADIUS, 0.8 * RADIUS), np.arange(-60.0, 60.0)))
    across, zero = x / RADIUS, np.zeros_like(x)
    along = np.sqrt(1.0 - across**2)
    tangents = np.stack([along, zero, -across], axis=-1)
    expected = unit(np.stack([across, zero + slope, along], axis=-1))
    true = unit(np.stack([across, zero + slope, along / depth], axis=-1))
    offsets = np.stack([x + SIDE, y, zero], axis=-1)
    view = np.broadcast_to([0.0, 0.0, 1.0], true.shape)
    if focal is not None:
        view = unit(np.stack([-(x + SIDE), -y, zero + focal], axis=-1))
    shown = moved_by_light(true, view, inverse * offsets)
    noise = np.random.default_rng(0).normal(0.0, np.radians(noise_deg), shown.shape)
    accepted = unit(shown + noise + [sphere_error, 0.0, 0.0])
    return WallNormals(accepted, expected, tangents, view, offsets, np.round(y).astype(int))


def measured(wall: WallNormals) -> DistanceChange:
    found = distance_by_wall(wall, SPHERE_SD)
    assert found is not None
    return found


@pytest.mark.parametrize("focal", [None, 600.0])
@pytest.mark.parametrize("slope", [0.0, 0.5])
@pytest.mark.parametrize("distance", [800.0, 2000.0])
def test_a_round_wall_shows_how_near_the_light_is(distance: float, slope: float, focal: float | None) -> None:
    found = measured(cylinder(1.0 / distance, focal=focal, slope=slope))
    assert found.change == pytest.approx(1.0 / distance, rel=0.15)
    assert found.standard_deviation < 0.35 / 800.0


def test_a_distant_light_is_left_where_it_is() -> None:
    found = measured(cylinder())
    assert abs(found.change) < 0.1 * found.standard_deviation


@pytest.mark.parametrize("depth", [0.98, 1.02])
def test_an_oval_body_does_not_pass_for_a_near_light(depth: float) -> None:
    found = measured(cylinder(depth=depth))
    assert abs(found.change) < 0.5 * found.standard_deviation


@pytest.mark.parametrize("sphere_error", [-SPHERE_SD, SPHERE_SD])
def test_a_misplaced_sphere_is_allowed_for(sphere_error: float) -> None:
    found = measured(cylinder(sphere_error=sphere_error))
    assert abs(found.change) < 2.0 * found.standard_deviation
    assert abs(found.change) < 0.7 * 2.0 * SPHERE_SD / SIDE


def test_outliers_do_not_move_the_light() -> None:
    wall = cylinder(1.0 / 1000.0)
    wall.accepted[::10] = unit(wall.accepted[::10] + np.array([0.1, 0.0, 0.0]))
    assert measured(wall).change == pytest.approx(1.0 / 1000.0, rel=0.15)


def test_few_normals_show_nothing() -> None:
    wall = cylinder(1.0 / 1000.0)
    assert distance_by_wall(WallNormals(*(part[:150] for part in wall)), SPHERE_SD) is None


def test_a_sphere_at_the_same_place_shows_nothing() -> None:
    wall = cylinder()
    assert distance_by_wall(wall._replace(offsets=np.zeros_like(wall.offsets)), SPHERE_SD) is None


def test_normals_of_the_wall_are_those_near_it() -> None:
    shape = (4, 5)
    expected = np.broadcast_to([0.0, 0.0, 1.0], (*shape, 3)).copy()
    tangents = np.broadcast_to([1.0, 0.0, 0.0], (*shape, 3)).copy()
    accepted = expected.copy()
    accepted[0], accepted[1, 0], tangents[2, 0] = unit(np.array([0.3, 0.0, 1.0])), np.nan, np.nan
    offsets = np.moveaxis(np.indices(shape).astype(float), 0, -1)
    wall = wall_normals(accepted, expected, tangents, offsets, None)
    assert len(wall.accepted) == 3 * 5 - 2
    assert wall.circles.tolist() == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3]
    np.testing.assert_array_equal(wall.offsets[0], [1.0, 1.0, 0.0])


def test_half_vectors_turn_by_half_the_angle_of_the_light() -> None:
    generator = np.random.default_rng(0)
    view = unit(generator.normal(0.0, 0.1, (50, 3)) + UPWARD)
    light = unit(generator.normal(0.0, 0.5, (50, 3)) + UPWARD)
    motion, half = 1e-4 * generator.normal(0.0, 1.0, (50, 3)), unit(light + view)
    moved = moved_by_light(half, view, motion)
    np.testing.assert_allclose(moved, unit(unit(light + motion) + view), atol=1e-12)
    np.testing.assert_allclose(moved - half, turned_by_light(half, view, motion), atol=1e-7)
    np.testing.assert_allclose(moved_by_light(half, view, np.zeros_like(motion)), half, atol=1e-12)
    overhead = np.broadcast_to([0.0, 0.0, 1.0], (50, 3))
    sideways = moved_by_light(overhead, overhead, np.array([0.02, 0.0, 0.0]))
    np.testing.assert_allclose(angles(sideways, overhead), np.degrees(np.arctan(0.02)) / 2.0)
