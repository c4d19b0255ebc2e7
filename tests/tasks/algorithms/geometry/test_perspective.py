"""Normals, half vectors and spheres under a perspective camera."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import (
    Cone,
    aimed_along,
    areal_focal_length,
    camera_in_crop,
    focal_length,
    half_vectors_for_view,
    half_vectors_on_axis,
    rotate_from_view,
    rotate_to_view,
    view_vectors,
)
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit

CAMERA = np.array([[500.0, 0, 100.0], [0, 480.0, 80.0], [0, 0, 1.0]])
VIEW = view_vectors(CAMERA, (161, 201), 0, 0)


def test_view_vectors_point_from_the_surface_to_the_camera() -> None:
    np.testing.assert_allclose(VIEW[80, 100], [0, 0, 1], atol=1e-12)
    assert VIEW[80, 200, 0] < 0 < VIEW[80, 0, 0] and VIEW[0, 100, 1] < 0 < VIEW[160, 100, 1]
    np.testing.assert_allclose(view_vectors(CAMERA, (10, 10), 60, 50), VIEW[50:60, 60:70])
    np.testing.assert_allclose(view_vectors(camera_in_crop(CAMERA, 60, 50), (10, 10), 0, 0), VIEW[50:60, 60:70])


def test_the_areal_focal_length_keeps_the_area_of_a_pixel() -> None:
    assert areal_focal_length(CAMERA) ** 2 == pytest.approx(500.0 * 480.0)
    assert focal_length(CAMERA) == 490.0


def test_half_vectors_under_perspective_are_the_normals_of_a_mirror() -> None:
    """A pixel that reflects the light into its own view vector has the half vector of both as its normal, and back."""
    normal = unit(np.array([0.2, -0.1, 1.0]))
    lights = 2 * (VIEW @ normal)[..., None] * normal - VIEW
    on_axis = half_vectors_of(lights).astype(np.float32)
    assert angles(half_vectors_for_view(on_axis[None], VIEW)[0], normal).max() < 0.1 < angles(on_axis, normal).max()
    assert angles(half_vectors_on_axis(np.broadcast_to(normal, VIEW.shape), VIEW), on_axis).max() < 0.1


def test_normals_are_rotated_to_their_own_view_and_back() -> None:
    normals = unit(np.random.default_rng(0).normal(size=(3, *VIEW.shape)))
    rotated = rotate_to_view(normals, VIEW)
    np.testing.assert_allclose(rotated[..., 2], (normals * VIEW).sum(axis=-1), atol=1e-5)
    np.testing.assert_allclose(rotate_from_view(rotated, VIEW), normals, atol=1e-5)


def test_a_camera_that_is_aimed_elsewhere_shows_things_there_as_large() -> None:
    forward = unit(np.array([0.5, -0.3, 1.0]))
    rotation, focal = aimed_along(forward, CAMERA)
    np.testing.assert_allclose(rotation @ forward, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    corners = forward + 1e-4 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    def area(matrix: np.ndarray, rays: np.ndarray) -> float:
        points = rays @ matrix.T
        first, second = np.diff(points[:, :2] / points[:, 2:], axis=0)
        return abs(float(first[0] * second[1] - first[1] * second[0]))

    aimed = np.array([[focal, 0.0, 0.0], [0.0, focal, 0.0], [0.0, 0.0, 1.0]])
    assert area(aimed, corners @ rotation.T) == pytest.approx(area(CAMERA, corners), rel=1e-3)


@pytest.mark.parametrize("centre", [(30.0, 10.0, -300.0), (-25.0, 20.0, -250.0)])
def test_a_sphere_follows_from_its_ellipse(centre: tuple[float, float, float]) -> None:
    """The pixels on the sphere have the ellipse's centre and area, from which the sphere and its normals follow."""
    position, size = np.array(centre), 12.0
    distance = float(np.linalg.norm(position))
    cone = Cone(position / distance, size / distance)
    x, y, radius = cone.project(CAMERA)
    rows, columns = np.nonzero(cone.sines(VIEW) < 1)
    assert (columns.mean(), rows.mean()) == pytest.approx((x, y), abs=0.2)
    assert np.sqrt(len(rows) / np.pi) == pytest.approx(radius, rel=0.02)
    back = Cone.from_ellipse(x, y, radius, CAMERA)
    np.testing.assert_allclose(back.axis, cone.axis, atol=1e-6)
    assert back.sine == pytest.approx(cone.sine, rel=1e-5)
    view = VIEW[rows, columns]
    points = position + size * back.normals(view)
    assert np.linalg.norm(np.cross(points, view), axis=-1).max() < 1e-3


@pytest.mark.parametrize(
    "circle", [(0.0, 0.0, 200.0), (200.0, 160.0, 300.0), (600.0, 580.0, 40.0), (700.0, -400.0, 500.0)]
)
def test_a_circle_that_no_sphere_has_still_gives_a_finite_cone(circle: tuple[float, float, float]) -> None:
    """The contours of large spheres far beside the line of sight are no ellipses; a search tries their circles too."""
    wide = np.array([[120.0, 0, 100.0], [0, 120.0, 80.0], [0, 0, 1.0]])
    assert np.isfinite(Cone.from_ellipse(*circle, wide).project(wide)).all()
