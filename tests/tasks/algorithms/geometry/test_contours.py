"""Contours of masks: sub-pixel places on shapes of known outline."""

import numpy as np

from glint.tasks.algorithms.geometry.contours import outermost_pixels, smooth_contour


def disc(radius: float, centre: tuple[float, float] = (50.3, 48.6)) -> np.ndarray:
    rows, columns = np.mgrid[:100, :104]
    return np.hypot(columns - centre[0], rows - centre[1]) < radius


def test_the_contour_of_a_disc_lies_on_its_edge() -> None:
    radii = np.hypot(*(smooth_contour(disc(40.0)) - (50.3, 48.6)).T)
    assert abs(radii.mean() - 40.0) < 0.2 and np.ptp(radii) < 1.2


def test_of_two_parts_the_longer_contour_is_taken() -> None:
    contour = smooth_contour(disc(20.0, (30.0, 50.0)) | disc(6.0, (80.0, 50.0)))
    assert contour[:, 0].max() < 55.0


def test_a_straight_edge_is_half_a_pixel_outside_its_pixels() -> None:
    mask = np.zeros((60, 60), bool)
    mask[10:50, 12:48] = True
    contour = smooth_contour(mask)
    beside = (contour[:, 1] > 25) & (contour[:, 1] < 35) & (contour[:, 0] < 30)
    np.testing.assert_allclose(contour[beside, 0], 11.5, atol=1e-6)


def test_a_line_of_single_pixels_has_a_contour() -> None:
    hairy = disc(20.0)
    hairy[49, 70:95] = True
    contour = smooth_contour(hairy)
    assert np.isfinite(contour).all() and contour[:, 0].max() > 90.0


def test_a_mask_goes_on_beyond_the_border_of_the_image_unless_that_is_outside() -> None:
    mask = np.ones((4, 5), bool)
    mask[:, 4] = False
    beside_it, ring = np.zeros_like(mask), mask.copy()
    beside_it[:, 3], ring[1:3, 1:3] = True, False
    assert np.array_equal(outermost_pixels(mask), beside_it)
    assert np.array_equal(outermost_pixels(mask, is_border_outside=True), ring)
