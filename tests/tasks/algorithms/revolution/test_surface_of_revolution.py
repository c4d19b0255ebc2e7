from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis
from tests.tasks.algorithms.revolution.beaker import tumbler

UPRIGHT = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)


def camera_positions() -> tuple[np.ndarray, np.ndarray]:
    columns, rows = np.meshgrid(np.arange(140) - 69.5, np.arange(200) - 99.5)
    return columns, -rows


def ribbed(tilt: float) -> SurfaceOfRevolution:
    """Return a vase whose wall waves by about seven degrees."""
    heights = np.arange(-60.0, 60.5, 0.5)
    radii = 40.0 + 0.8 * np.sin(heights / 6.0)
    radii[[0, -1]] = 0.0
    return SurfaceOfRevolution(UPRIGHT, np.radians(tilt), heights, radii**2, np.gradient(radii**2, heights) / 2.0)


def test_a_dome_continues_behind_its_shoulder() -> None:
    x, y = camera_positions()
    surface = SurfaceOfRevolution.from_silhouette(np.hypot(x, y) < 65, UPRIGHT, np.radians(40.0))
    inner = np.hypot(x, y) < 55
    truth = np.stack([x, y, np.sqrt(np.maximum(65.0**2 - x**2 - y**2, 0.0))], axis=-1)[inner] / 65.0
    found = surface.normals(x[inner], y[inner])
    assert np.median(angles(found, truth)) < 2.0
    assert np.percentile(angles(found, truth), 95) < 8.0


@pytest.mark.parametrize("turn", [0.0, 5.0, 12.0])
@pytest.mark.parametrize("step", [0.5, 1.0])
def test_a_level_cone_keeps_its_slope_however_it_lies_in_the_image(turn: float, step: float) -> None:
    x, y = camera_positions()
    along = np.array([-np.sin(np.radians(turn)), np.cos(np.radians(turn))])
    axis = ReflectionAxis(np.zeros(2), np.array([along[1], -along[0]]), 1.0)
    across, height = x * axis.normal[0] + y * axis.normal[1], x * along[0] + y * along[1]
    surface = SurfaceOfRevolution.from_silhouette(
        (np.abs(across) < 40.0 + 0.02 * height) & (np.abs(height) < 75.0), axis, 0.0, step
    )
    wall = np.abs(surface.heights) < 65.0
    radii = np.sqrt(surface.squared_radii[wall])
    assert np.abs(radii - 40.0 - 0.02 * surface.heights[wall]).max() < 0.4
    assert np.abs(np.degrees(surface.half_slopes[wall] / radii) - np.degrees(0.02)).max() < 2.0


@pytest.mark.parametrize("tilt", [0.0, 25.0, -25.0])
def test_rays_hit_the_surface_and_its_normals_point_outwards(tilt: float) -> None:
    surface = ribbed(tilt)
    x, y = (coordinate.ravel() for coordinate in camera_positions())
    hits, normals = surface.intersect(x, y), surface.normals(x, y)
    inside = np.isfinite(hits.heights)
    assert 0.2 < inside.mean() < 0.8
    assert np.isnan(normals[~inside]).all()
    assert np.allclose(np.linalg.norm(normals[inside], axis=1), 1.0)
    assert (normals[inside, 2] > 0.0).mean() > 0.98
    position = hits.heights[:, None] * surface.frame.upward + hits.outward
    assert np.abs(position[inside, 0] - x[inside]).max() < 1e-6
    assert np.abs(position[inside, 1] - y[inside]).max() < 1e-6


def test_normals_correct_the_slopes_of_whole_circles() -> None:
    truth = ribbed(12.0)
    smooth = replace(truth, half_slopes=np.where(np.abs(truth.heights) < 59.0, 0.0, truth.half_slopes))
    x, y = (coordinate.ravel() for coordinate in camera_positions())
    exact = truth.normals(x, y)
    inside = np.isfinite(exact[:, 0]) & (np.abs(truth.intersect(x, y).heights) < 55)
    near = inside & (exact[:, 2] > np.cos(np.radians(40.0)))
    noisy = exact + np.random.default_rng(0).normal(0, np.radians(1.0), exact.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    fitted = smooth.with_fitted_slopes(x[near], y[near], noisy[near])
    beside = inside & ~near
    before, after = (angles(model.normals(x, y), exact)[beside].mean() for model in (smooth, fitted))
    assert beside.sum() > 1000
    assert after < 0.25 * before
    assert np.array_equal(fitted.squared_radii, truth.squared_radii)


def test_more_normals_correct_slopes_further_and_normals_of_another_wall_do_not() -> None:
    surface = ribbed(0.0)
    middle = int(np.argmin(np.abs(surface.heights)))

    def correction(degrees: float, count: int) -> float:
        x, y = np.zeros(count), np.linspace(-0.5, 0.5, count)
        normals = surface.normals(x, y)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        rotated = np.column_stack(
            [normals[:, 0], c * normals[:, 1] + s * normals[:, 2], c * normals[:, 2] - s * normals[:, 1]]
        )
        return float(abs(surface.with_fitted_slopes(x, y, rotated).half_slopes[middle] - surface.half_slopes[middle]))

    assert correction(5.0, 15) > 1.5 * correction(5.0, 3) > 0.0
    assert correction(50.0, 15) == 0.0


@pytest.mark.parametrize("tilt", [20.0, -20.0])
def test_the_end_that_faces_the_camera_is_cut_off(tilt: float) -> None:
    whole = tumbler(tilt, 60.0, 45.0)
    shorter = whole.cut_off(10.0)
    assert shorter.end_height == pytest.approx(whole.end_height - 10.0 * np.sign(tilt), abs=0.6)
    assert shorter.end_radius == pytest.approx(whole.end_radius - 1.25 * np.sign(tilt), abs=0.2)
    # At its middle the camera looks on the flat end.
    x, y = np.zeros(1), np.array([shorter.end_height * np.cos(np.radians(tilt))])
    assert shorter.is_end(x, y).all() and whole.cut_off(0.0) is whole


def test_nothing_is_cut_off_where_no_end_faces_the_camera() -> None:
    level = tumbler(0.0, 60.0, 45.0)
    assert level.cut_off(10.0) is level


@pytest.mark.parametrize("step", [1.0, 4.0, 10.0])
def test_rays_through_the_end_are_told_from_others_whatever_the_step(step: float) -> None:
    heights = np.arange(-700.0, 701.0, step)
    radii = np.where(np.abs(heights) < 699.0, 400.0, 0.0)
    radii[[0, -1]] = 0.0
    surface = SurfaceOfRevolution(UPRIGHT, np.radians(30.0), heights, radii**2, np.gradient(radii**2, heights) / 2.0)
    azimuth, share = (grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 6.0, 40), np.linspace(0.05, 0.97, 20)))
    middle, aspect = surface.end_height * np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    for scale, is_end in ((1.0, True), (1.07, False)):
        x = scale * 400.0 * (share if is_end else 1.0) * np.cos(azimuth)
        y = middle + scale * 400.0 * (share if is_end else 1.0) * aspect * np.sin(azimuth)
        assert surface.is_end(x, y).mean() == pytest.approx(float(is_end), abs=0.03)
