import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.relief import find_relief
from tests.tasks.algorithms.revolution.beaker import SHAPE, beaker_normals, beaker_surface, camera_positions, observable

TILT = 14.0


def turned(deviation: np.ndarray) -> np.ndarray:
    """Return the beaker's normals (H, W, 3), its wall's turned by (H, W, 2) radians round the axis and along it."""
    surface, normals = beaker_surface(TILT), beaker_normals(TILT)
    x, y = (values.ravel() for values in camera_positions())
    outward = unit(surface.intersect(x, y).outward).reshape(*SHAPE, 3)
    along = np.cross(surface.frame.upward, outward)
    is_wall = np.abs(normals @ surface.frame.upward) < 0.5
    moved = normals + np.tan(deviation[..., :1]) * along + np.tan(deviation[..., 1:]) * surface.frame.upward
    return np.where(is_wall[..., None], unit(moved), normals)


def cylindrical() -> tuple[np.ndarray, np.ndarray]:
    """Return azimuth and height (H, W) of the beaker's points."""
    surface = beaker_surface(TILT)
    x, y = (values.ravel() for values in camera_positions())
    hits = surface.intersect(x, y)
    forward = np.cross([1.0, 0.0, 0.0], surface.frame.upward)
    return np.arctan2(hits.outward[:, 0], hits.outward @ forward).reshape(SHAPE), hits.heights.reshape(SHAPE)


def hobnails(periods: int) -> np.ndarray:
    """Return deviations (H, W, 2) in radians that repeat round the axis."""
    azimuth, height = cylindrical()
    row = 2.0 * np.pi * height / 22.0
    round_axis, along = np.sin(periods * azimuth) * np.cos(row), np.cos(periods * azimuth) * np.sin(row)
    return 0.35 * np.where(np.abs(height)[..., None] < 50.0, np.stack([round_axis, along], axis=-1), 0.0)


def measured(truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and the normals of what highlights show."""
    shown = observable(truth)
    known = np.isfinite(shown[..., 0])
    x, y = camera_positions()
    return x[known], y[known], shown[known]


@pytest.mark.parametrize("periods", [14])
def test_hobnails_are_found_and_fill_what_highlights_do_not_show(periods: int) -> None:
    truth = np.where(turned(hobnails(periods))[..., 2:] > 0.0, turned(hobnails(periods)), beaker_normals(TILT))
    mask = np.isfinite(truth[..., 0])
    relief = find_relief(mask, beaker_surface(TILT + 3.0), *measured(truth))
    assert relief is not None
    assert relief.periods == periods
    assert abs(np.degrees(relief.surface.tilt) - TILT) < 1.5
    x, y = camera_positions()
    base = beaker_normals(TILT)[mask]
    found = relief.normals(x[mask], y[mask], observable(truth)[mask], base)
    _, height = cylindrical()
    flank = (np.abs(height) < 45.0)[mask] & (np.abs(x[mask]) < 36.0) & np.isnan(observable(truth)[mask][:, 0])
    assert flank.sum() > 500
    assert np.median(angles(found, truth[mask])[flank]) < 0.4 * np.median(angles(base, truth[mask])[flank])
    smooth = (np.abs(height) > 58.0)[mask] & (truth[mask] @ beaker_surface(TILT).frame.upward < 0.5)
    assert np.median(angles(found, base)[smooth]) < 0.5


def test_normals_that_do_not_repeat_are_no_relief() -> None:
    generator = np.random.default_rng(3)
    mask = np.isfinite(beaker_normals(TILT)[..., 0])
    noise = 0.2 * generator.normal(size=(*SHAPE, 2))
    assert find_relief(mask, beaker_surface(TILT), *measured(turned(noise))) is None
    azimuth, _ = cylindrical()
    bulge = np.stack([0.3 * np.sin(azimuth**2 * 4.0), 0.0 * azimuth], axis=-1)
    assert find_relief(mask, beaker_surface(TILT), *measured(turned(bulge))) is None


def test_normals_beside_the_wall_are_no_relief() -> None:
    mask = np.isfinite(beaker_normals(TILT)[..., 0])
    beside = np.full(30, 200.0)
    assert find_relief(mask, beaker_surface(TILT), beside, beside, np.tile((0.0, 0.0, 1.0), (30, 1))) is None


def test_a_few_normals_of_a_flat_face_are_no_relief() -> None:
    """Where two periods show parts of it, each predicts the other, and the surface contradicts both."""
    mask = np.isfinite(beaker_normals(TILT)[..., 0])
    x, y = (values[mask] for values in camera_positions())
    patch = (np.abs(x - 15.0) < 8.0) & (np.abs(y) < 25.0)
    face = unit(np.array([-0.3, 0.6, 0.74]) + np.random.default_rng(0).normal(0.0, 0.01, (int(patch.sum()), 3)))
    assert find_relief(mask, beaker_surface(TILT), x[patch], y[patch], face) is None
