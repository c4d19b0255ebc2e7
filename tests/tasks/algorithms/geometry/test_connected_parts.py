import numpy as np
import pytest

from glint.tasks.algorithms.geometry.connected_parts import largest_part, neighbours


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


@pytest.mark.parametrize(("down", "right"), [(0, 1), (1, -1), (1, 0), (1, 1)])
def test_neighbours_lie_as_far_apart_as_was_asked(down: int, right: int) -> None:
    places = np.moveaxis(np.indices((4, 5)), 0, -1)
    first, second = neighbours((4, 5), down, right)
    assert (places[second] - places[first] == (down, right)).all()
    assert places[first].size == 2 * (4 - down) * (5 - abs(right))
