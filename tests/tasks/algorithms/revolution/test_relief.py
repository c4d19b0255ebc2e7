import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.relief import Relief, find_relief
from tests.tasks.algorithms.revolution.beaker import (
    SHAPE,
    beaker_normals,
    beaker_surface,
    camera_positions,
    cylindrical,
    observable,
    turned,
)

TILT = 14.0


def hobnails(periods: int) -> np.ndarray:
    """Return deviations (H, W, 2) in radians that repeat round the axis."""
    azimuth, height = cylindrical(TILT)
    row = 2.0 * np.pi * height / 22.0
    round_axis, along = np.sin(periods * azimuth) * np.cos(row), np.cos(periods * azimuth) * np.sin(row)
    return 0.35 * np.where(np.abs(height)[..., None] < 50.0, np.stack([round_axis, along], axis=-1), 0.0)


def with_false_candidates(truth: np.ndarray) -> np.ndarray:
    """Return candidates (2, N, 3) in the beaker: what highlights show of the true normals, and false ones.

    The false ones are a smooth sheet in one half of the places, and random in the other.
    """
    generator = np.random.default_rng(5)
    mask = np.isfinite(truth[..., 0])
    x, y = (values[mask] for values in camera_positions())
    sheet = unit(np.column_stack([np.sin(x / 30.0), np.cos(y / 25.0) - 0.3, np.full_like(x, 1.5)]))
    random = unit(np.column_stack([generator.uniform(-1.0, 1.0, (len(x), 2)), np.ones_like(x)]))
    return np.stack([observable(truth)[mask], np.where((y > 0.0)[:, None], sheet, random)])


def positions(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (N,) in a mask."""
    x, y = camera_positions()
    return x[mask], y[mask]


def found_relief(truth: np.ndarray, tilt: float = TILT, *, false_share: float = 0.15) -> Relief | None:
    """Return the relief found among candidates of normals (H, W, 3) if a share of the accepted ones is false."""
    mask, candidates = np.isfinite(truth[..., 0]), with_false_candidates(truth)
    is_false = np.random.default_rng(7).random(mask.sum()) < false_share
    accepted = np.where(is_false[:, None], candidates[1], candidates[0])
    return find_relief(mask, beaker_surface(tilt), *positions(mask), accepted, candidates)


@pytest.mark.parametrize("periods", [14])
def test_hobnails_are_found_among_false_candidates_and_fill_what_highlights_do_not_show(periods: int) -> None:
    truth = np.where(
        turned(hobnails(periods), TILT)[..., 2:] > 0.0, turned(hobnails(periods), TILT), beaker_normals(TILT)
    )
    mask = np.isfinite(truth[..., 0])
    relief = found_relief(truth, TILT + 1.5)
    assert relief is not None
    assert relief.periods == periods
    assert abs(np.degrees(relief.surface.tilt) - TILT) <= 1.5
    base, (x, y) = beaker_normals(TILT)[mask], positions(mask)
    found = relief.normals(x, y, base)
    _, height = cylindrical(TILT)
    flank = (np.abs(height) < 45.0)[mask] & (np.abs(x) < 36.0) & np.isnan(observable(truth)[mask][:, 0])
    assert flank.sum() > 500
    assert np.median(angles(found, truth[mask])[flank]) < 0.4 * np.median(angles(base, truth[mask])[flank])
    smooth = (np.abs(height) > 58.0)[mask] & (truth[mask] @ beaker_surface(TILT).frame.upward < 0.5)
    assert np.median(angles(found, base)[smooth]) < 0.5


def test_accepted_normals_alone_show_a_relief_if_they_are_true() -> None:
    truth = np.where(turned(hobnails(14), TILT)[..., 2:] > 0.0, turned(hobnails(14), TILT), beaker_normals(TILT))
    mask = np.isfinite(truth[..., 0])
    accepted = observable(truth)[mask]
    nothing_else = np.full((1, *accepted.shape), np.nan)
    relief = find_relief(mask, beaker_surface(TILT), *positions(mask), accepted, nothing_else)
    assert relief is not None and relief.periods == 14


def test_a_relief_that_most_accepted_normals_contradict_is_none() -> None:
    truth = np.where(turned(hobnails(14), TILT)[..., 2:] > 0.0, turned(hobnails(14), TILT), beaker_normals(TILT))
    assert found_relief(truth, false_share=0.15) is not None
    assert found_relief(truth, false_share=0.9) is None


def test_normals_that_do_not_repeat_are_no_relief() -> None:
    generator = np.random.default_rng(3)
    assert found_relief(turned(0.2 * generator.normal(size=(*SHAPE, 2)), TILT)) is None
    azimuth, _ = cylindrical(TILT)
    assert found_relief(turned(np.stack([0.3 * np.sin(azimuth**2 * 4.0), 0.0 * azimuth], axis=-1), TILT)) is None


def test_a_smooth_wall_which_repeats_after_any_angle_has_no_relief() -> None:
    assert found_relief(beaker_normals(TILT)) is None


def test_normals_beside_the_wall_are_no_relief() -> None:
    mask = np.isfinite(beaker_normals(TILT)[..., 0])
    beside, facing = np.full(30, 200.0), np.tile((0.0, 0.0, 1.0), (30, 1))
    assert find_relief(mask, beaker_surface(TILT), beside, beside, facing, facing[None]) is None


def test_a_few_normals_of_a_flat_face_are_no_relief() -> None:
    """Where two periods show parts of it, each shows what the other does."""
    mask = np.isfinite(beaker_normals(TILT)[..., 0])
    x, y = positions(mask)
    patch = (np.abs(x - 15.0) < 8.0) & (np.abs(y) < 25.0)
    face = unit(np.array([-0.3, 0.6, 0.74]) + np.random.default_rng(0).normal(0.0, 0.01, (int(patch.sum()), 3)))
    assert find_relief(mask, beaker_surface(TILT), x[patch], y[patch], face, face[None]) is None
