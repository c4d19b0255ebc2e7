import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside, inradius_of, with_nearest


def test_distances_are_the_exact_ones_wherever_the_array_lies_in_memory() -> None:
    generator = np.random.default_rng(0)
    held = []
    for count in range(40):
        height, width = generator.integers(20, 90, 2)
        region = generator.random((height, width)) < 0.995
        region[0, 0] = False
        exact = np.sqrt(np.rint(ndimage.distance_transform_edt(region) ** 2).astype(np.float32))
        assert np.array_equal(distance_inside(region), exact)
        held.append(np.zeros(100 * count + int(generator.integers(1, 5000))))


def test_long_distances_are_exact() -> None:
    region = np.ones((800, 30), bool)
    region[0, 0] = False
    rows, columns = np.indices(region.shape)
    assert np.array_equal(distance_inside(region), np.sqrt((rows**2 + columns**2).astype(np.float32)))


def test_the_edge_of_an_image_is_outside_of_its_mask() -> None:
    mask = np.ones((9, 13), bool)
    assert depth_inside(mask)[0, 0] == 1.0
    assert inradius_of(mask) == 5.0


def test_missing_normals_are_those_of_the_nearest_pixel_in_the_mask_alone() -> None:
    normals = np.full((3, 4, 3), np.nan)
    normals[0, 0], normals[2, 3] = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    mask = np.ones((3, 4), bool)
    mask[2, 2:] = False
    complete = with_nearest(normals, mask)
    assert complete[0, 1].tolist() == [0.0, 0.0, 1.0] and complete[1, 3].tolist() == [1.0, 0.0, 0.0]
    assert np.isnan(complete[~mask]).all() and np.isfinite(complete[mask]).all()
