"""Inverse focal lengths from the normals of known surfaces, as a single sphere shows them."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.near_light.focal_length_of_normals import (
    UnknownCamera,
    focal_length_of_normals,
    log_depth_gradients,
)

SHAPE = (90, 110)
CAMERA = UnknownCamera(left=40, top=50, sphere_x=240.0, sphere_y=110.0, width=320, height=200)


def normals_of(inverse_focal: float, dome: float = 60.0, bump: float = 4.0) -> np.ndarray:
    """The normals (H, W, 3) of a bumpy dome that the sphere shows, if its view vector is taken for the optical axis.

    dome: radius of curvature at the top in pixels; bump: height of the bumps, likewise.
    """
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    x, y = columns - 0.5 * SHAPE[1], 0.5 * SHAPE[0] - rows
    height = -0.5 * (x**2 + y**2) / dome + bump * np.sin(x / 15.0) * np.cos(y / 11.0)
    p, q = np.gradient(height, axis=1), -np.gradient(height, axis=0)
    matrix = CAMERA.matrix(inverse_focal)
    view = view_vectors(matrix, SHAPE, CAMERA.left, CAMERA.top)
    # A gradient of the distance's logarithm (times the focal length) has this normal along the ray.
    slopes = view[..., :2] / view[..., 2:]
    normals = unit(np.stack([-p, -q, 1.0 + slopes[..., 0] * p + slopes[..., 1] * q], axis=-1))
    lights = 2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view
    of_sphere = view_vectors(matrix, (1, 1), CAMERA.sphere_x, CAMERA.sphere_y)
    return half_vectors_of(rotate_to_view(lights, np.broadcast_to(of_sphere, lights.shape)))


@pytest.mark.parametrize("focal_widths", [0.8, 1.5, 3.0])
def test_a_near_camera_is_measured(focal_widths: float) -> None:
    inverse = 1.0 / (focal_widths * CAMERA.width)
    noise = np.random.default_rng(1).normal(0.0, np.radians(1.0), (*SHAPE, 3))
    estimate = focal_length_of_normals(unit(normals_of(inverse) + noise), CAMERA)
    assert estimate is not None
    assert estimate.value == pytest.approx(inverse, rel=0.1)
    assert estimate.deviation < 0.1 / CAMERA.width


def test_a_distant_camera_is_measured_as_such() -> None:
    estimate = focal_length_of_normals(normals_of(1e-9), CAMERA)
    assert estimate is not None
    assert abs(estimate.value) * CAMERA.width < 0.02


def test_a_false_sheet_does_not_hide_a_near_camera() -> None:
    inverse = 1.0 / CAMERA.width
    normals = normals_of(inverse)
    normals[20:40, 20:50] = normals_of(inverse, dome=-90.0)[20:40, 20:50]
    normals[60:, :30] = np.nan
    estimate = focal_length_of_normals(normals, CAMERA)
    assert estimate is not None
    assert estimate.value == pytest.approx(inverse, rel=0.25)


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 35.0])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3, 2e-2])
def test_normals_that_integrate_under_any_camera_show_none(tilt_deg: float, noise: float) -> None:
    tilt = np.radians(tilt_deg)
    plane = np.zeros((*SHAPE, 3)) + np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    normals = unit(plane + np.random.default_rng(2).normal(0.0, noise, plane.shape))
    assert focal_length_of_normals(normals, CAMERA) is None


def test_an_estimate_beyond_the_bound_is_no_more_certain_than_the_bound() -> None:
    inverse = 2.6 / CAMERA.width
    estimate = focal_length_of_normals(normals_of(inverse), CAMERA)
    assert estimate is not None
    assert estimate.value == pytest.approx(2.0 / CAMERA.width)
    assert estimate.deviation >= estimate.value


def test_few_normals_show_nothing() -> None:
    normals = np.full((*SHAPE, 3), np.nan)
    normals[10:15, 10:15] = normals_of(1e-9)[10:15, 10:15]
    assert focal_length_of_normals(normals, CAMERA) is None


def test_normals_of_one_block_show_nothing_as_their_standard_error_is_unknown() -> None:
    normals = np.full((*SHAPE, 3), np.nan)
    block = np.s_[31:44, 37:54]
    normals[block] = normals_of(1.0 / CAMERA.width)[block]
    assert focal_length_of_normals(normals, CAMERA) is None


def test_gradients_of_some_pixels_are_those_of_all() -> None:
    normals, inverse = normals_of(1e-9), 1.0 / CAMERA.width
    of_all = log_depth_gradients(normals, CAMERA, inverse)
    of_some = log_depth_gradients(normals[::3, ::3], CAMERA, inverse, step=3)
    assert np.ptp(of_all[0]) > 0.1
    for whole, some in zip(of_all, of_some, strict=True):
        assert np.allclose(whole[::3, ::3], some, atol=1e-5)
