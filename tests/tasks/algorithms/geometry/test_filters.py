import numpy as np
import pytest
from scipy import ndimage

from glint.tasks.algorithms.geometry.blur import gaussian_blur
from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside, inradius_of


def test_distance_is_exact() -> None:
    region = np.random.default_rng(0).random((150, 170)) < 0.995
    assert np.allclose(distance_inside(region), ndimage.distance_transform_edt(region), atol=1e-4)


def test_depth_counts_the_border_of_the_image_as_outside() -> None:
    rows, columns = np.mgrid[:91, :91] - 45
    disc = np.hypot(rows, columns) <= 45.0
    assert abs(inradius_of(disc) - 45.0) <= 1.0
    full = np.ones((5, 9), dtype=bool)
    assert depth_inside(full).shape == full.shape
    assert depth_inside(full)[0, 4] == 1.0 and inradius_of(full) == 3.0


@pytest.mark.parametrize(("sd", "tolerance"), [(2.0, 1e-5), (12.0, 1e-5), (30.0, 1.5e-3)])
def test_blur_is_gaussian_also_where_it_is_made_in_a_smaller_image(sd: float, tolerance: float) -> None:
    noise = np.random.default_rng(0).normal(size=(203, 250))
    values = (ndimage.gaussian_filter(noise, 8.0) > 0).astype(float)
    assert np.allclose(gaussian_blur(values, sd), ndimage.gaussian_filter(values, sd), atol=tolerance)


@pytest.mark.parametrize("shape", [(400, 3), (3, 400), (1, 1), (2, 2)])
def test_a_narrow_image_is_blurred_by_more_than_its_width(shape: tuple[int, int]) -> None:
    values = np.random.default_rng(0).normal(size=shape)
    assert np.allclose(gaussian_blur(values, 60.0), ndimage.gaussian_filter(values, 60.0), atol=1e-4)
