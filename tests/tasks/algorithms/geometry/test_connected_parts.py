import numpy as np

from glint.tasks.algorithms.geometry.connected_parts import largest_part


def test_the_largest_part_is_kept() -> None:
    mask = np.zeros((8, 9), bool)
    mask[1:3, 1:3] = mask[4:7, 4:8] = True
    largest = np.zeros_like(mask)
    largest[4:7, 4:8] = True
    assert np.array_equal(largest_part(mask), largest)


def test_corners_do_not_connect() -> None:
    mask = np.zeros((4, 4), bool)
    mask[0, 0] = mask[1, 1] = mask[1, 2] = True
    assert largest_part(mask).sum() == 2


def test_nothing_has_no_part() -> None:
    assert not largest_part(np.zeros((3, 4), bool)).any()


def test_the_pixels_of_a_contour_connect_across_corners() -> None:
    oblique = np.eye(6, dtype=bool)
    oblique[5, 0:3] = True
    assert np.array_equal(largest_part(oblique, diagonal=True), np.eye(6, dtype=bool))
    assert largest_part(oblique).sum() == 3
