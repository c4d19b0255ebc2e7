"""Vectors in the camera frame."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import equal_area, unit


def test_equal_area_map_keeps_areas_and_azimuths() -> None:
    vectors = unit(np.random.default_rng(0).normal(size=(200_000, 3)))
    x, y = equal_area(vectors).T
    np.testing.assert_allclose(np.arctan2(y, x), np.arctan2(vectors[:, 1], vectors[:, 0]), atol=1e-9)
    angle = np.arccos(vectors[:, 2])
    np.testing.assert_allclose(np.hypot(x, y), 2.0 * np.sin(angle / 2.0), atol=1e-6)
    # Directions that are spread evenly over the sphere are spread evenly over the disc of radius 2.
    assert abs((np.hypot(x, y) < 1.0).mean() - 0.25) < 0.005
