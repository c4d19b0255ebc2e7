"""Vectors in the camera frame."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import (
    NZ_FLOOR,
    angles,
    equal_area,
    gradients,
    pixel_positions,
    sampled_pixels,
    unit,
)


def test_equal_area_map_keeps_areas_and_azimuths() -> None:
    vectors = unit(np.random.default_rng(0).normal(size=(200_000, 3)))
    x, y = equal_area(vectors).T
    np.testing.assert_allclose(np.arctan2(y, x), np.arctan2(vectors[:, 1], vectors[:, 0]), atol=1e-9)
    angle = np.arccos(vectors[:, 2])
    np.testing.assert_allclose(np.hypot(x, y), 2.0 * np.sin(angle / 2.0), atol=1e-6)
    # Directions that are spread evenly over the sphere are spread evenly over the disc of radius 2.
    assert abs((np.hypot(x, y) < 1.0).mean() - 0.25) < 0.005
    assert np.isfinite(equal_area(np.array([0.0, 0.0, -1.0]))).all()


def test_positions_of_pixels_come_row_by_row_from_the_centre() -> None:
    pixels = np.zeros((3, 5), bool)
    pixels[0, 4] = pixels[1, 2] = pixels[2, 0] = True
    x, y = pixel_positions(pixels)
    assert x.tolist() == [2.0, 0.0, -2.0] and y.tolist() == [1.0, 0.0, -1.0]


def test_angles_are_exact_from_none_to_opposite() -> None:
    turns = np.radians([0.0, 1e-6, 90.0, 150.0, 180.0])
    turned = np.stack([np.sin(turns), np.zeros(5), np.cos(turns)], axis=-1)
    np.testing.assert_allclose(angles(turned, np.array([0.0, 0.0, 1.0])), np.degrees(turns), rtol=1e-6)


def test_slopes_of_normals_in_the_image_plane_are_bounded() -> None:
    p, q = gradients(np.array([[0.6, 0.0, 0.8], [0.0, -1.0, 0.0], [1.0, 0.0, -0.1]]))
    np.testing.assert_allclose(p, [-0.75, 0.0, -1.0 / NZ_FLOOR])
    np.testing.assert_allclose(q, [0.0, 1.0 / NZ_FLOOR, 0.0])


def test_sampled_pixels_are_spread_over_the_mask_and_the_same_every_time() -> None:
    mask = np.zeros((40, 50), bool)
    mask[5:35, 10:40] = True
    rows, columns = sampled_pixels(mask, 100)
    assert len(set(zip(rows.tolist(), columns.tolist(), strict=True))) == 100 and mask[rows, columns].all()
    assert np.ptp(rows) > 25 and np.ptp(columns) > 25
    assert np.array_equal(sampled_pixels(mask, 100), (rows, columns))
    assert len(sampled_pixels(mask, 10_000)[0]) == mask.sum()
