import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.multiview.view import rotation_about_y
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.revolution.symmetry import surface_of_revolution_normals
from glint.tasks.algorithms.vessels.body_normals import COMPLETED_LIMITS, IMPERFECT_LIMITS
from glint.tasks.algorithms.vessels.rotational_normals import RotationalSymmetry
from tests.tasks.algorithms.revolution.beaker import (
    beaker_normals,
    bowl_on_stem,
    camera_positions,
    cylindrical,
    false_sheets,
    flared_vase,
    observable,
    seen_normals,
    turned,
)
from tests.tasks.algorithms.revolution.cylinder import CAMERA, SHAPE, seen_cylinder


def test_a_body_is_found_with_its_handle() -> None:
    beaker = beaker_normals(14.0)
    body = np.isfinite(beaker[..., 0])
    x, y = camera_positions()
    # A ring of round section about a point of the body's right contour: its left half lies before the body.
    distance = np.hypot(x - 38.0, y)
    across = np.clip((distance - 20.0) / 8.0, -1.0, 1.0)
    handle = np.abs(across) < 1.0
    outward = np.stack([x - 38.0, y], axis=-1) / np.maximum(distance, 1.0)[..., None] * across[..., None]
    ring = np.dstack([outward, np.sqrt(1.0 - across**2)])
    truth, mask = np.where(handle[..., None], ring, beaker), body | handle
    observed = observable(truth)
    accepted = np.where((handle & body)[..., None], np.nan, observed)
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    result = RotationalSymmetry(mask, None).normals(accepted, observed[None], flat)
    assert result is not None
    found = result.normals
    error = angles(found, truth)
    assert np.isfinite(found[mask]).all() and np.isnan(found[~mask]).all()
    assert np.median(error[body & ~handle]) < 2.0
    assert np.median(error[handle & ~body]) < 5.0
    assert np.median(error[handle & body]) < 5.0


def test_a_flared_rim_belongs_to_the_body_though_its_accepted_normals_are_those_of_the_far_wall() -> None:
    surface = flared_vase(14.0)
    truth = seen_normals(surface)
    _, y = camera_positions()
    mask, is_rim = np.isfinite(truth[..., 0]), y > 48.0
    accepted = observable(np.where(is_rim[..., None], seen_normals(surface, far=True), truth))
    assert np.isfinite(accepted[is_rim & mask, 0]).mean() > 0.5
    candidates, field = np.stack([observable(truth), accepted]), truth @ rotation_about_y(7.0).T
    assert surface_of_revolution_normals(SilhouetteSymmetry(mask), accepted, candidates, field) is None
    result = RotationalSymmetry(mask, None).normals(accepted, candidates, field)
    assert result is not None
    error = angles(result.normals, truth)
    assert np.median(error[mask & ~is_rim]) < 2.0 and np.median(error[mask & is_rim]) < 4.0


def test_a_surface_of_revolution_is_found_where_the_mask_lacks_a_part_of_one_side() -> None:
    truth = beaker_normals(14.0)
    x, y = camera_positions()
    mask = np.isfinite(truth[..., 0]) & ~((x > 20.0) & (y < -10.0))
    accepted = np.where(mask[..., None], observable(truth), np.nan)
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    result = RotationalSymmetry(mask, None).normals(accepted, accepted[None], flat)
    assert result is not None
    assert np.array_equal(np.isfinite(result.normals[..., 0]), mask)
    assert not np.isfinite(result.depths[~mask]).any()
    assert np.median(angles(result.normals, truth)[mask]) < 2.0


def test_normals_contradict_a_mask_that_lacks_the_same_on_both_sides() -> None:
    truth = beaker_normals(14.0)
    x, y = camera_positions()
    mask = np.isfinite(truth[..., 0]) & ~((np.abs(x) > 35.0) & (y > 0.0))
    accepted = np.where(mask[..., None], observable(truth), np.nan)
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    narrow = surface_of_revolution_normals(SilhouetteSymmetry(mask), accepted, accepted[None], flat)
    result = RotationalSymmetry(mask, None).normals(accepted, accepted[None], flat)
    assert narrow is not None and result is not None
    wrong, right = (angles(fit.normals, truth)[mask & (y > 10.0)].mean() for fit in (narrow, result))
    assert right < 0.6 * wrong


def test_what_was_observed_decides_where_accepted_normals_fit_smooth_field_and_surface_alike() -> None:
    truth = beaker_normals(14.0)
    mask, field = np.isfinite(truth[..., 0]), truth @ rotation_about_y(8.0).T
    accepted = np.where(camera_positions()[0][..., None] < 0.0, unit(truth + field), np.nan)
    symmetry = RotationalSymmetry(mask, None)
    assert symmetry.normals(accepted, truth[None], field) is None
    normals = symmetry.unproven_normals(accepted, truth[None], field)
    assert normals is not None and np.nanmedian(angles(normals, truth)) < 4.0
    assert symmetry.unproven_normals(accepted, field[None], field) is None


def test_a_relief_does_not_excuse_a_completed_silhouette() -> None:
    azimuth, _ = cylindrical(14.0)
    ribs = turned(np.stack([np.radians(25.0) * np.sin(16.0 * azimuth), 0.0 * azimuth], axis=-1), 14.0)
    mask = np.isfinite(beaker_normals(14.0)[..., 0])
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    fit = SilhouetteSymmetry(mask), ribs, ribs[None], flat
    ribbed = surface_of_revolution_normals(*fit, IMPERFECT_LIMITS)
    assert ribbed is not None and ribbed.relief_fit > 0.0
    assert surface_of_revolution_normals(*fit, COMPLETED_LIMITS) is None


@pytest.mark.parametrize(("tilt", "lean"), [(20.0, 0.0), (-25.0, 12.0), (2.0, -8.0)])
def test_a_surface_of_revolution_is_found_before_a_perspective_camera(tilt: float, lean: float) -> None:
    normals, distances = seen_cylinder(tilt, lean)
    mask = np.isfinite(distances)
    truth = rotate_to_view(normals, view_vectors(CAMERA, SHAPE, 0.0, 0.0))
    accepted, field = observable(truth), np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    result = RotationalSymmetry(mask, CAMERA).normals(accepted, accepted[None], field)
    assert result is not None
    assert np.array_equal(np.isfinite(result.normals[..., 0]), mask)
    error = angles(result.normals, truth)[mask]
    assert np.median(error) < 1.0 and np.mean(error < 5.0) > 0.9
    known = mask & np.isfinite(result.depths) & (truth[..., 2] > 0.3)
    difference = (result.depths + CAMERA[0, 0] * np.log(distances))[known]
    assert known.sum() > 0.7 * mask.sum()
    assert np.percentile(np.abs(difference - np.median(difference)), 95) < 1.5
    parallel = RotationalSymmetry(mask, None).normals(accepted, accepted[None], field)
    assert parallel is None or angles(parallel.normals, truth)[mask].mean() > 2.0 * error.mean()


@pytest.mark.parametrize("tilt", [8.0, -14.0])
def test_candidates_alone_show_a_surface_of_revolution(tilt: float) -> None:
    truth = seen_normals(bowl_on_stem(tilt))
    mask = np.isfinite(truth[..., 0])
    false = np.where(mask[..., None], false_sheets(3), np.nan)
    symmetry = RotationalSymmetry(mask, None)
    supposed = symmetry.supposed_normals(np.concatenate([observable(truth)[None], false]))
    assert supposed is not None
    error = angles(supposed, truth)[mask]
    assert np.median(error) < 3.0 and np.mean(error < 8.0) > 0.8
    assert symmetry.supposed_normals(false[:1]) is None
    assert symmetry.supposed_normals(np.full_like(false, np.nan)) is None


def test_candidates_show_the_body_of_a_vessel_before_a_perspective_camera() -> None:
    normals, distances = seen_cylinder(20.0, 0.0)
    mask = np.isfinite(distances)
    truth = rotate_to_view(normals, view_vectors(CAMERA, SHAPE, 0.0, 0.0))
    supposed = RotationalSymmetry(mask, CAMERA).supposed_normals(observable(truth)[None])
    assert supposed is not None and np.array_equal(np.isfinite(supposed[..., 0]), mask)
    assert np.median(angles(supposed, truth)[mask]) < 4.0
