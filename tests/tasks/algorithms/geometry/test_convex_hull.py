"""The convex hull of pixels."""

import numpy as np

from glint.tasks.algorithms.geometry.convex_hull import convex_hull


def test_the_hull_of_corners_is_their_rectangle() -> None:
    pixels = np.zeros((8, 10), bool)
    pixels[[1, 1, 5, 5], [2, 7, 2, 7]] = True
    expected = np.zeros_like(pixels)
    expected[1:6, 2:8] = True
    np.testing.assert_array_equal(convex_hull(pixels), expected)


def test_single_pixels_are_their_own_hull() -> None:
    pixels = np.zeros((4, 4), bool)
    pixels[2, 1] = True
    np.testing.assert_array_equal(convex_hull(pixels), pixels)
