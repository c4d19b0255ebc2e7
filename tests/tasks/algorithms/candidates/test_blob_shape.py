"""Centres of bright blobs, also of those that a window cuts, and what is a single highlight."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.candidates.blob_shape import blob_centre, is_single_highlight


def blob(rows: slice, columns: slice) -> np.ndarray:
    """Return a rectangle in a window of 20 x 40 pixels."""
    window = np.zeros((20, 40), bool)
    window[rows, columns] = True
    return window


def test_the_centre_of_a_compact_blob_is_its_centroid_wherever_it_was_clicked() -> None:
    assert blob_centre(blob(slice(4, 9), slice(10, 17)), (11.0, 5.0)) == (13.0, 6.0)


def test_a_compact_blob_at_the_border_of_the_window_has_no_known_centre() -> None:
    inside = blob(slice(1, 6), slice(1, 6))
    assert blob_centre(inside, (3.0, 3.0)) == (3.0, 3.0)
    for rows, columns in ((0, 1), (1, 0), (15, 1), (1, 35)):
        assert blob_centre(blob(slice(rows, rows + 5), slice(columns, columns + 5)), (3.0, 3.0)) is None


def test_of_a_line_the_nearest_point_counts_though_the_window_cuts_it() -> None:
    line = blob(slice(8, 10), slice(0, 40))
    assert blob_centre(line, (12.0, 14.0)) == pytest.approx((12.0, 8.5))
    # A line's ends are round, as the light is: three times its width of it are a highlight's.
    assert blob_centre(line, (-9.0, 8.0)) == pytest.approx((19.5 - (20.0 - 3.0), 8.5))


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_the_centre_of_a_line_that_is_thicker_at_one_end_lies_on_it(is_mirrored: bool) -> None:
    line = blob(slice(8, 9), slice(2, 38)) | blob(slice(8, 10), slice(2, 14))
    assert is_single_highlight(line)
    centre = blob_centre(line[:, ::-1], (42.0, 8.5)) if is_mirrored else blob_centre(line, (-3.0, 8.5))
    assert centre == pytest.approx((37.0 if is_mirrored else 2.0, 8.5), abs=0.2)


def test_a_highlight_fills_its_convex_hull() -> None:
    disc = cv2.circle(np.zeros((40, 40), np.uint8), (20, 20), 9, 1, -1) > 0
    bent = blob(slice(2, 18), slice(4, 8)) | blob(slice(14, 18), slice(4, 20))
    cross = blob(slice(5, 6), slice(3, 8)) | blob(slice(3, 8), slice(5, 6))
    assert not is_single_highlight(cross)
    assert is_single_highlight(disc) and is_single_highlight(blob(slice(3, 4), slice(5, 6)))
    assert is_single_highlight(blob(slice(3, 4), slice(5, 30))) and not is_single_highlight(bent)


@pytest.mark.parametrize(("missing", "is_single"), [(7, True), (8, False)])
def test_a_single_highlight_fills_four_fifths_of_the_pixels_of_its_hull(missing: int, is_single: bool) -> None:
    pierced = blob(slice(4, 9), slice(10, 17))
    pierced[5:8, 11:16] = np.arange(15).reshape(3, 5) >= missing
    assert pierced.sum() == 35 - missing
    assert is_single_highlight(pierced) is is_single
