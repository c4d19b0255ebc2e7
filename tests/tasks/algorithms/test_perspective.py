"""Normals under a perspective camera."""

import numpy as np

from tasks.algorithms.geometry import angles, half_vectors_of, unit
from tasks.algorithms.perspective import towards, views

CAMERA = np.array([[500.0, 0, 100.0], [0, 500.0, 80.0], [0, 0, 1.0]])


def test_views_point_from_the_surface_to_the_camera() -> None:
    found = views(CAMERA, (161, 201), 0, 0)
    np.testing.assert_allclose(found[80, 100], [0, 0, 1], atol=1e-12)
    assert found[80, 200, 0] < 0 < found[80, 0, 0] and found[0, 100, 1] < 0 < found[160, 100, 1]
    np.testing.assert_allclose(views(CAMERA, (10, 10), 60, 50), found[50:60, 60:70])


def test_a_mirror_under_perspective_is_read_rightly() -> None:
    """A pixel that mirrors the light into its own ray has the half vector of both as its normal."""
    here = views(CAMERA, (161, 201), 0, 0)
    normal = unit(np.array([0.2, -0.1, 1.0]))
    lights = 2 * (here @ normal)[..., None] * normal - here
    seen = half_vectors_of(lights)[None].astype(np.float32)
    assert angles(towards(seen, CAMERA, 0, 0)[0], normal).max() < 0.1
    assert towards(seen, None, 0, 0) is seen
