from collections.abc import Callable

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.prior.smooth_normals import smooth_normal_field
from glint.tasks.algorithms.prior.unreached import (
    BEYOND_DEG,
    SweptNormals,
    dark_pixels,
    unreached_normals,
    with_unreached,
)

SWEEP_DEG = 40.0
"""Angle to the view up to which the lights of these scenes reach normals."""
SCALE = 40.0


def cone(step_deg: float = 1.0, inner_deg: float = 0.0) -> np.ndarray:
    """Candidates (3, N, 1, 3): half vectors `step_deg` apart, between two angles to the view."""
    tilts = np.radians(np.arange(max(inner_deg, step_deg), SWEEP_DEG, step_deg))
    turns = np.radians(np.arange(0.0, 360.0, 1.0))
    tilt, turn = (grid.ravel() for grid in np.meshgrid(tilts, turns))
    half_vectors = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    return np.repeat(half_vectors[None, :, None], 3, axis=0).astype(np.float32)


def tilted(degrees: float, azimuth_deg: float = 0.0) -> np.ndarray:
    tilt, turn = np.radians(degrees), np.radians(azimuth_deg)
    return np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])


@pytest.fixture(scope="module")
def swept() -> SweptNormals:
    result = SweptNormals.of(cone())
    assert result is not None
    return result


def groove() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, true normals and what the lights show of a plane with a groove that is deepest in its middle."""
    rows, columns = np.indices((91, 91)) - 45.0
    depth = 10.0 * np.exp(-((rows / 18.0) ** 2)) * np.exp(-((columns / 5.0) ** 2))
    across, up = 2.0 * columns / 25.0 * depth, -2.0 * rows / 324.0 * depth
    truth = unit(np.stack([-across, -up, np.ones(rows.shape)], axis=-1))
    return rows**2 + columns**2 < 44.0**2, truth, truth[..., 2] > np.cos(np.radians(SWEEP_DEG))


def solver(mask: np.ndarray, truth: np.ndarray, known: np.ndarray) -> Callable[[np.ndarray | None], np.ndarray]:
    surface = smooth_normal_field(mask)

    def solve(unreached: np.ndarray | None) -> np.ndarray:
        targets, weights = np.where(known[..., None], truth, np.nan), np.where(known, 0.1, 0.0)
        if unreached is not None:
            targets, weights = with_unreached(targets, weights, unreached, 0.1)
        return surface.solve(targets, weights)

    return solve


def test_lights_reach_what_they_show_and_nothing_beyond(swept: SweptNormals) -> None:
    normals = np.stack([tilted(20.0), tilted(39.0, 130.0), tilted(50.0), np.full(3, np.nan)])
    assert swept.flashes(normals).tolist() == [True, True, False, False]
    moved = swept.nearest_beyond(normals[:3])
    assert np.allclose(np.linalg.norm(moved, axis=-1), 1.0)
    tilts = angles(moved[:2], tilted(0.0))
    assert tilts.min() > SWEEP_DEG + BEYOND_DEG - 2.0 and tilts.max() < SWEEP_DEG + BEYOND_DEG + 2.0
    assert np.degrees(np.arctan2(moved[1, 1], moved[1, 0])) == pytest.approx(130.0, abs=3.0)
    assert angles(moved[2], tilted(50.0)) < 0.01


def test_no_surface_hides_between_two_rings_of_lights_but_inside_a_single_one() -> None:
    spiral, ring = SweptNormals.of(cone(step_deg=6.0)), SweptNormals.of(cone(inner_deg=25.0))
    assert spiral is not None and ring is not None
    between = tilted(21.0)
    assert not spiral.flashes(between)
    assert angles(spiral.nearest_beyond(between), tilted(0.0)) > SWEEP_DEG - 5.0
    assert angles(ring.nearest_beyond(tilted(5.0)), tilted(5.0)) < 0.01


def test_without_candidates_nothing_is_known() -> None:
    assert SweptNormals.of(np.full((2, 5, 5, 3), np.nan, np.float32)) is None


def test_single_pixels_without_a_highlight_are_not_dark(swept: SweptNormals) -> None:
    mask = np.ones((40, 40), bool)
    field = np.broadcast_to(tilted(10.0), (40, 40, 3))
    accepted = np.random.default_rng(0).random(mask.shape) < 0.85
    assert not dark_pixels(field, accepted, mask, swept, SCALE).any()
    accepted[10:20, 10:20] = False
    dark = dark_pixels(field, accepted, mask, swept, SCALE)
    assert dark[10:20, 10:20].all() and dark.sum() < 130
    steep = np.broadcast_to(tilted(60.0), (40, 40, 3))
    assert not dark_pixels(steep, accepted, mask, swept, SCALE).any()


def test_walls_of_a_groove_are_steep_and_face_each_other(swept: SweptNormals) -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    field = solve(None)
    found = unreached_normals(field, known * 0.95, known, mask, swept, SCALE, solve)
    assert found is not None
    unreached, bent = found
    hidden = mask & ~known
    before, after = angles(field[hidden], truth[hidden]), angles(bent[hidden], truth[hidden])
    assert before.mean() > 25.0 and after.mean() < 0.7 * before.mean()
    dark = np.isfinite(unreached[..., 0])
    assert not (dark & known).any() and (dark & hidden).sum() > 0.7 * hidden.sum()
    assert (np.sign(unreached[dark][:, 0]) == np.sign(truth[dark][:, 0])).mean() > 0.9


def test_where_something_may_be_a_true_highlight_nothing_is_dark(swept: SweptNormals) -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    assert unreached_normals(solve(None), known * 0.95, mask, mask, swept, SCALE, solve) is None


def test_where_most_is_dark_darkness_says_nothing(swept: SweptNormals) -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    few = known & (np.random.default_rng(0).random(mask.shape) < 0.4)
    assert unreached_normals(solve(None), few * 0.95, few, mask, swept, SCALE, solve) is None


def test_what_the_lights_show_stays_as_it_is(swept: SweptNormals) -> None:
    mask, truth, _ = groove()
    solve = solver(mask, truth, mask)
    assert unreached_normals(solve(None), mask * 0.95, mask, mask, swept, SCALE, solve) is None


def test_other_data_come_before_dark_pixels() -> None:
    targets, weights = np.zeros((1, 3, 3)), np.array([[0.1, 0.0, 0.0]])
    unreached = np.array([[tilted(50.0), tilted(50.0), np.full(3, np.nan)]])
    merged, pull = with_unreached(targets, weights, unreached, 0.03)
    assert pull.tolist() == [[0.1, 0.03, 0.0]]
    assert np.array_equal(merged[0], [targets[0, 0], unreached[0, 1], targets[0, 2]])
