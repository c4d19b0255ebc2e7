import warnings

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.revolution.symmetry import FitLimits, surface_of_revolution_normals
from glint.tasks.algorithms.silhouettes.reflection_axes import reflection_axes
from tests.tasks.algorithms.revolution.beaker import SHAPE, beaker_normals, camera_positions, observable, turned


def no_candidates() -> np.ndarray:
    return np.full((1, *SHAPE, 3), np.nan)


@pytest.mark.parametrize("tilt", [14.0, 30.0, -20.0])
def test_a_surface_of_revolution_is_found_with_its_flat_end(tilt: float) -> None:
    truth = beaker_normals(tilt)
    mask = np.isfinite(truth[..., 0])
    found = surface_of_revolution_normals(SilhouetteSymmetry(mask), observable(truth), no_candidates())
    assert found is not None and found.relief_fit == 0.0
    error = angles(found.normals, truth)[mask]
    assert np.median(error) < 2.0
    end = truth @ np.array([0.0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))]) * np.sign(tilt) > 0.99
    assert end.sum() > 500
    assert np.median(angles(found.normals, truth)[end]) < 5.0
    assert np.isfinite(found.normals[mask]).all() and np.isnan(found.normals[~mask]).all()


def test_a_flat_end_alone_shows_no_axis() -> None:
    """Any flat face would be the end of some surface of revolution."""
    truth, normal = beaker_normals(30.0), np.array([0.0, np.cos(np.radians(30.0)), np.sin(np.radians(30.0))])
    silhouette = SilhouetteSymmetry(np.isfinite(truth[..., 0]))
    end = np.where((truth @ normal > 0.99)[..., None], truth, np.nan)
    assert surface_of_revolution_normals(silhouette, end, no_candidates()) is None


def test_circles_of_which_candidates_show_another_slope_as_well_have_a_rival() -> None:
    truth = beaker_normals(14.0)
    mask, (_, y) = np.isfinite(truth[..., 0]), camera_positions()
    end = truth @ np.array([0.0, np.cos(np.radians(14.0)), np.sin(np.radians(14.0))]) > 0.99
    steeper = turned(np.broadcast_to(np.radians([0.0, 15.0]), (*SHAPE, 2)), 14.0)
    sheets = np.stack([observable(truth), np.where((y < 0.0)[..., None], observable(steeper), np.nan)])
    found = surface_of_revolution_normals(SilhouetteSymmetry(mask), observable(truth), sheets)
    assert found is not None and found.rivalry is not None
    assert found.rivalry.dtype == np.float32
    lower, upper = mask & (y > -50.0) & (y < -20.0), mask & (y > 20.0) & (y < 50.0)
    assert np.median(found.rivalry[lower]) > 0.7 and np.median(found.rivalry[upper]) < 0.1
    assert (found.rivalry[~mask] == 0.0).all() and np.median(found.rivalry[end]) == 0.0


@pytest.mark.long
def test_an_opening_shows_the_far_wall() -> None:
    solid, inside = beaker_normals(20.0), beaker_normals(20.0, far=True)
    mask = np.isfinite(solid[..., 0])
    end = mask & (solid @ np.array([0.0, np.cos(np.radians(20.0)), np.sin(np.radians(20.0))]) > 0.99)
    truth = np.where(end[..., None], inside, solid)
    # The far wall is seen through the near one as well.
    wall = observable(inside)
    accepted = np.where(end[..., None], np.nan, observable(solid))
    opened = surface_of_revolution_normals(SilhouetteSymmetry(mask), accepted, wall[None])
    closed = surface_of_revolution_normals(SilhouetteSymmetry(mask), accepted, no_candidates())
    assert opened is not None and closed is not None
    visible = end & (inside[..., 2] > 0.3)
    assert np.median(angles(opened.normals, truth)[visible]) < 5.0
    assert np.median(angles(closed.normals, truth)[visible]) > 30.0


def test_a_symmetric_object_that_is_not_rotationally_symmetric_is_left_alone() -> None:
    x, y = camera_positions()
    mask = (np.abs(x) < 50) & (np.abs(y) < 80)
    roof = np.where(x[..., None] < 0, (-0.6, 0.0, 0.8), (0.6, 0.0, 0.8))
    assert reflection_axes(mask)
    assert (
        surface_of_revolution_normals(
            SilhouetteSymmetry(mask), np.where(mask[..., None], roof, np.nan), no_candidates()
        )
        is None
    )


def test_an_asymmetric_silhouette_has_no_axis() -> None:
    x, y = camera_positions()
    mask = (np.hypot(x, y + 40) < 40) | (np.hypot(x - 30, y - 20) < 22) | ((np.abs(x + 5) < 6) & (np.abs(y) < 70))
    accepted = np.where(mask[..., None], (0.0, 0.0, 1.0), np.nan)
    assert reflection_axes(mask) == []
    assert surface_of_revolution_normals(SilhouetteSymmetry(mask), accepted, no_candidates()) is None


def test_without_accepted_normals_there_is_no_surface() -> None:
    x, y = camera_positions()
    assert (
        surface_of_revolution_normals(
            SilhouetteSymmetry(np.hypot(x, y) < 60), np.full((*SHAPE, 3), np.nan), no_candidates()
        )
        is None
    )


def test_surfaces_inside_a_silhouette_are_kept_and_do_not_depend_on_earlier_fits() -> None:
    truth = beaker_normals(14.0)
    silhouette = SilhouetteSymmetry(np.isfinite(truth[..., 0]))
    first = surface_of_revolution_normals(silhouette, observable(truth), no_candidates())
    assert silhouette.surface(0, 0.2, 1.0) is silhouette.surface(0, 0.2, 1.0)
    other = beaker_normals(14.0) * np.array([1.0, 1.0, -1.0])
    surface_of_revolution_normals(silhouette, observable(other), no_candidates())
    again = surface_of_revolution_normals(silhouette, observable(truth), no_candidates())
    assert first is not None and again is not None
    assert np.array_equal(first.normals, again.normals, equal_nan=True)


def test_a_surface_must_explain_normals_much_better_than_a_flat_face_does() -> None:
    angles = np.radians(np.linspace(-20.0, 20.0, 41))
    accepted = np.stack([np.sin(angles), np.zeros(41), np.cos(angles)], axis=-1)[None]
    mean = float(np.degrees(np.abs(angles)).mean())
    assert np.isclose(FitLimits(90.0, 0.4).largest_error(accepted, None), 0.4 * mean)
    assert FitLimits(2.0, 0.4).largest_error(accepted, None) == 2.0
    assert FitLimits(90.0, 0.4).largest_error(accepted, accepted) < 1e-3


def test_without_accepted_normals_none_is_contradicted() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert FitLimits(5.0, 0.4).largest_error(np.full((4, 4, 3), np.nan), None) == 5.0
