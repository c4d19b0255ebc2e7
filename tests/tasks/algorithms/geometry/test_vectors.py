"""Vectors in the camera frame."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import equal_area, pixel_positions, unit


def test_equal_area_map_keeps_areas_and_azimuths() -> None:
    vectors = unit(np.random.default_rng(0).normal(size=(200_000, 3)))
    x, y = equal_area(vectors).T
    np.testing.assert_allclose(np.arctan2(y, x), np.arctan2(vectors[:, 1], vectors[:, 0]), atol=1e-9)
    angle = np.arccos(vectors[:, 2])
    np.testing.assert_allclose(np.hypot(x, y), 2.0 * np.sin(angle / 2.0), atol=1e-6)
    # Directions that are spread evenly over the sphere are spread evenly over the disc of radius 2.
    assert abs((np.hypot(x, y) < 1.0).mean() - 0.25) < 0.005


def test_positions_of_pixels_come_row_by_row_from_the_centre() -> None:
    pixels = np.zeros((3, 5), bool)
    pixels[0, 4] = pixels[1, 2] = pixels[2, 0] = True
    x, y = pixel_positions(pixels)
    assert x.tolist() == [2.0, 0.0, -2.0] and y.tolist() == [1.0, 0.0, -1.0]
