"""Bowls that the camera looks into, rendered from formulas."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.vessels.bowls import accepted_bowl, bowl_rims, find_bowl
from glint.tasks.algorithms.vessels.rotational_normals import RotationalSymmetry
from tests.tasks.algorithms.revolution.beaker import (
    SHAPE,
    beaker_normals,
    camera_positions,
    false_sheets,
    observable,
    seen_bowl,
)


@pytest.mark.parametrize("tilt", [35.0, 55.0])
def test_the_inside_of_a_bowl_follows_from_its_rim_and_the_normals_of_its_far_side(tilt: float) -> None:
    truth, depths = seen_bowl(tilt)
    mask, (x, _) = np.isfinite(truth[..., 0]), camera_positions()
    accepted = np.where((np.abs(x) < 30.0)[..., None], observable(truth), np.nan)
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    bowl = accepted_bowl(bowl_rims(SilhouetteSymmetry(mask)), accepted, flat)
    assert bowl is not None and np.array_equal(np.isfinite(bowl.normals[..., 0]), mask)
    error = angles(bowl.normals, truth)[mask]
    assert np.median(error) < 1.0 and np.mean(error < 10.0) > 0.9
    difference = (bowl.depths - depths)[mask]
    assert np.nanpercentile(np.abs(difference - np.nanmedian(difference)), 80) < 1.0


def test_candidates_alone_show_a_bowl_and_accepted_normals_are_those_of_it() -> None:
    truth, _ = seen_bowl(40.0)
    mask = np.isfinite(truth[..., 0])
    candidates = np.concatenate([observable(truth)[None], np.where(mask[..., None], false_sheets(2), np.nan)])
    symmetry = RotationalSymmetry(mask, None)
    supposed = symmetry.supposed_normals(candidates)
    assert supposed is not None and np.median(angles(supposed, truth)[mask]) < 4.0
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    result = symmetry.normals(observable(truth), candidates, flat)
    assert result is not None and np.median(angles(result.normals, truth)[mask]) < 4.0


def test_a_vessel_seen_from_its_side_and_normals_of_no_surface_are_no_bowl() -> None:
    beaker = beaker_normals(14.0)
    assert find_bowl(bowl_rims(SilhouetteSymmetry(np.isfinite(beaker[..., 0]))), observable(beaker)[None]) is None
    truth, _ = seen_bowl(40.0)
    mask = np.isfinite(truth[..., 0])
    flat, (false,) = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan), false_sheets(1)
    assert accepted_bowl(bowl_rims(SilhouetteSymmetry(mask)), np.where(mask[..., None], false, np.nan), flat) is None
    few = np.where((np.arange(SHAPE[1]) == SHAPE[1] // 2)[None, :, None], observable(truth), np.nan)
    few[::2] = np.nan
    assert find_bowl(bowl_rims(SilhouetteSymmetry(mask)), few[None]) is None


def test_a_dome_is_no_bowl_although_its_silhouette_is_that_of_one() -> None:
    x, y = camera_positions()
    rise = np.sqrt(np.clip(60.0**2 - x**2 - (1.5 * y) ** 2, 0.0, None))
    mask = rise > 0.0
    dome = np.stack([x, 2.25 * y, rise], axis=-1)
    dome = np.where(mask[..., None], dome / np.maximum(np.linalg.norm(dome, axis=-1, keepdims=True), 1e-9), np.nan)
    flat = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    assert accepted_bowl(bowl_rims(SilhouetteSymmetry(mask)), observable(dome), flat) is None
