import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, to_camera
from glint.tasks.algorithms.prior.reflection_axes import Axis, mirror_axes
from glint.tasks.algorithms.prior.surface_of_revolution import Turned
from glint.tasks.algorithms.prior.symmetry import turned_normals

SHAPE = (200, 140)


def pixels() -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.indices(SHAPE).astype(float)
    return to_camera(columns, rows, SHAPE[1], SHAPE[0])


def view(profile: np.ndarray, heights: np.ndarray, tilt: float, far: bool = False) -> np.ndarray:
    """Normals (H, W, 3) of a body of that profile (radii over heights), NaN beside it; `tilt` in degrees."""
    slopes = np.gradient(profile**2, heights) / 2.0
    axis = Axis(np.zeros(2), np.array([1.0, 0.0]), 1.0)
    body = Turned(axis, np.radians(tilt), heights, profile**2, slopes)
    x, y = pixels()
    return body.normals(x.ravel(), y.ravel(), far).reshape(*SHAPE, 3)


def beaker() -> tuple[np.ndarray, np.ndarray]:
    """Radii and heights of a slightly conical solid with flat ends."""
    heights = np.arange(-75.0, 76.0, 0.5)
    radii = 40.0 + 0.1 * heights
    radii[[0, -1]] = 0.0
    return radii, heights


def seen(normals: np.ndarray) -> np.ndarray:
    """What highlights could tell of normals (H, W, 3): those within 40 degrees of the view axis."""
    return np.where(normals[..., 2:] > np.cos(np.radians(40.0)), normals, np.nan)


def nothing() -> np.ndarray:
    return np.full((1, *SHAPE, 3), np.nan)


@pytest.mark.parametrize("tilt", [14.0, 30.0, -20.0])
def test_a_turned_body_is_found_with_its_flat_end(tilt: float) -> None:
    truth = view(*beaker(), tilt)
    mask = np.isfinite(truth[..., 0])
    found = turned_normals(mask, seen(truth), nothing())
    assert found is not None
    error = angles(found, truth)[mask]
    assert np.median(error) < 2.0
    end = truth @ np.array([0.0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))]) * np.sign(tilt) > 0.99
    assert end.sum() > 500
    assert np.median(angles(found, truth)[end]) < 5.0
    assert np.isfinite(found[mask]).all() and np.isnan(found[~mask]).all()


def test_an_opening_shows_the_far_wall() -> None:
    solid, inside = view(*beaker(), 20.0), view(*beaker(), 20.0, far=True)
    mask = np.isfinite(solid[..., 0])
    end = mask & (solid @ np.array([0.0, np.cos(np.radians(20.0)), np.sin(np.radians(20.0))]) > 0.99)
    truth = np.where(end[..., None], inside, solid)
    wall = np.where(end, 0.0, np.nan)[..., None] + seen(inside)
    accepted = np.where(end[..., None], np.nan, seen(solid))
    found = turned_normals(mask, accepted, wall[None])
    closed = turned_normals(mask, accepted, nothing())
    assert found is not None and closed is not None
    told = end & (inside[..., 2] > 0.3)
    assert np.median(angles(found, truth)[told]) < 5.0
    assert np.median(angles(closed, truth)[told]) > 30.0


def test_a_symmetric_object_that_is_not_turned_is_left_alone() -> None:
    x, y = pixels()
    mask = (np.abs(x) < 50) & (np.abs(y) < 80)
    roof = np.where(x[..., None] < 0, (-0.6, 0.0, 0.8), (0.6, 0.0, 0.8))
    assert mirror_axes(mask)
    assert turned_normals(mask, np.where(mask[..., None], roof, np.nan), nothing()) is None


def test_an_asymmetric_silhouette_has_no_axis() -> None:
    x, y = pixels()
    mask = (np.hypot(x, y + 40) < 40) | (np.hypot(x - 30, y - 20) < 22) | ((np.abs(x + 5) < 6) & (np.abs(y) < 70))
    assert mirror_axes(mask) == []
    assert turned_normals(mask, np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan), nothing()) is None


def test_nothing_accepted_tells_nothing() -> None:
    x, y = pixels()
    assert turned_normals(np.hypot(x, y) < 60, np.full((*SHAPE, 3), np.nan), nothing()) is None
