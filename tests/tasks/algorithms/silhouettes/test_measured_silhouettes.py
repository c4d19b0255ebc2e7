import numpy as np
import pytest

from glint.tasks.algorithms.silhouettes.measured_silhouettes import measured_silhouettes
from tests.tasks.algorithms.overlap import overlap
from tests.tasks.algorithms.revolution.beaker import SHAPE, beaker_normals, camera_positions, observable, tumbler


@pytest.mark.parametrize("tilt", [0.0, 14.0, -20.0])
def test_normals_show_the_wall_that_a_mask_lacks_on_both_sides(tilt: float) -> None:
    truth = beaker_normals(tilt)
    whole = np.isfinite(truth[..., 0])
    x, y = camera_positions()
    mask = whole & ~((np.abs(x) > 24.0) & (np.abs(y) < 40.0))
    assert overlap(mask, whole) < 0.85
    measured = measured_silhouettes(mask, np.where(mask[..., None], observable(truth), np.nan))
    assert len(measured) == 2
    assert max(overlap(silhouette, whole) for silhouette in measured) > 0.95


def test_normals_show_the_body_beside_a_filled_handle() -> None:
    truth = beaker_normals(14.0)
    whole = np.isfinite(truth[..., 0])
    x, y = camera_positions()
    mask = whole | (np.hypot(x - 30.0, y) < 40.0)
    measured = measured_silhouettes(mask, observable(truth))
    assert overlap(mask, whole) < 0.9
    assert max(overlap(silhouette, whole) for silhouette in measured) > 0.95


def test_a_fifth_of_false_normals_does_not_change_the_silhouette() -> None:
    truth = beaker_normals(14.0)
    whole = np.isfinite(truth[..., 0])
    random = np.random.default_rng(0)
    false = np.stack([*random.uniform(-0.5, 0.5, (2, *SHAPE)), np.ones(SHAPE)], axis=-1)
    false /= np.linalg.norm(false, axis=-1, keepdims=True)
    seen = observable(truth)
    mixed = np.where((random.random(SHAPE) < 0.2)[..., None] & np.isfinite(seen), false, seen)
    assert max(overlap(silhouette, whole) for silhouette in measured_silhouettes(whole, mixed)) > 0.93


def test_the_normals_of_a_sphere_show_its_disc() -> None:
    x, y = camera_positions()
    ratio = np.hypot(x - 6.0, y + 4.0) / 50.0
    disc = ratio < 1.0
    normals = np.stack([(x - 6.0) / 50.0, (y + 4.0) / 50.0, np.sqrt(np.clip(1.0 - ratio**2, 0.0, None))], axis=-1)
    mask = disc & (x < 40.0) | (np.hypot(x + 30.0, y - 20.0) < 30.0)
    (measured,) = measured_silhouettes(mask, np.where((mask & disc)[..., None], observable(normals), np.nan))
    assert overlap(mask, disc) < 0.9 and overlap(measured, disc) > 0.98


@pytest.mark.parametrize("tilt", [30.0, 40.0])
def test_the_far_wall_of_an_open_vessel_is_no_sphere(tilt: float) -> None:
    vessel = tumbler(tilt, 60.0 if tilt == 30.0 else 30.0, 45.0)
    x, y = (places.ravel() for places in camera_positions())
    normals, is_end = vessel.normals(x, y), vessel.is_end(x, y)
    normals[is_end] = vessel.normals(x[is_end], y[is_end], far=True)
    shown = normals.reshape(*SHAPE, 3)
    whole = np.isfinite(shown[..., 0])
    # Of circles there are two silhouettes.
    assert len(measured_silhouettes(whole, observable(shown))) == 2


def test_too_few_normals_measure_nothing() -> None:
    truth = beaker_normals(14.0)
    few = np.full_like(truth, np.nan)
    few[90:95, 60:65] = truth[90:95, 60:65]
    assert measured_silhouettes(np.isfinite(truth[..., 0]), few) == []


def test_a_face_towards_the_camera_has_no_radius() -> None:
    x, y = camera_positions()
    mask = (np.abs(x) < 40.0) & (np.abs(y) < 60.0)
    assert measured_silhouettes(mask, np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)) == []
