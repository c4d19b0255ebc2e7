"""Normals, half vectors and balls under a perspective camera."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import Cone, cone_of, facing, in_camera, straight, towards, views
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit

CAMERA = np.array([[500.0, 0, 100.0], [0, 480.0, 80.0], [0, 0, 1.0]])
HERE = views(CAMERA, (161, 201), 0, 0)


def test_views_point_from_the_surface_to_the_camera() -> None:
    np.testing.assert_allclose(HERE[80, 100], [0, 0, 1], atol=1e-12)
    assert HERE[80, 200, 0] < 0 < HERE[80, 0, 0] and HERE[0, 100, 1] < 0 < HERE[160, 100, 1]
    np.testing.assert_allclose(views(CAMERA, (10, 10), 60, 50), HERE[50:60, 60:70])


def test_a_mirror_under_perspective_is_read_rightly() -> None:
    """A pixel that mirrors the light into its own ray has the half vector of both as its normal, and back."""
    normal = unit(np.array([0.2, -0.1, 1.0]))
    lights = 2 * (HERE @ normal)[..., None] * normal - HERE
    seen = half_vectors_of(lights).astype(np.float32)
    assert angles(towards(seen[None], HERE)[0], normal).max() < 0.1 < angles(seen, normal).max()
    assert angles(straight(np.broadcast_to(normal, HERE.shape), HERE), seen).max() < 0.1


def test_normals_are_turned_to_their_own_ray_and_back() -> None:
    normals = unit(np.random.default_rng(0).normal(size=(3, *HERE.shape)))
    turned = facing(normals, HERE)
    np.testing.assert_allclose(turned[..., 2], (normals * HERE).sum(axis=-1), atol=1e-5)
    np.testing.assert_allclose(in_camera(turned, HERE), normals, atol=1e-5)


@pytest.mark.parametrize("centre", [(30.0, 10.0, -300.0), (-25.0, 20.0, -250.0)])
def test_a_balls_outline_tells_the_ball(centre: tuple[float, float, float]) -> None:
    """The pixels that meet the ball have the outline's centre and area; from these follow the ball and its normals."""
    place, size = np.array(centre), 12.0
    away = float(np.linalg.norm(place))
    cone = Cone(place / away, size / away)
    x, y, radius = cone.outline(CAMERA)
    rows, columns = np.nonzero(cone.slopes(HERE) < 1)
    assert (columns.mean(), rows.mean()) == pytest.approx((x, y), abs=0.2)
    assert np.sqrt(len(rows) / np.pi) == pytest.approx(radius, rel=0.02)
    back = cone_of(x, y, radius, CAMERA)
    np.testing.assert_allclose(back.axis, cone.axis, atol=1e-6)
    assert back.sine == pytest.approx(cone.sine, rel=1e-5)
    view = HERE[rows, columns]
    points = place + size * back.normals(view)
    assert np.linalg.norm(np.cross(points, view), axis=-1).max() < 1e-3
