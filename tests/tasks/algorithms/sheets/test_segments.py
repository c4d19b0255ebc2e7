import numpy as np
import pytest

from glint.tasks.algorithms.sheets.segments import segment_sheets, sheet_means
from tests.tasks.algorithms.sheets.two_sheets import tilted, two_sheets


def test_sheets_end_at_creases_and_gaps() -> None:
    sheets = segment_sheets(two_sheets())
    assert len(np.unique(sheets[10:30, :30])) == len(np.unique(sheets[10:30, 30:])) == 1
    assert len({sheets[20, 5], sheets[20, 50], sheets[35, 10]}) == 3
    assert (sheets[:10] == -1).all()


def test_diagonal_neighbours_belong_together_and_nothing_is_no_sheet() -> None:
    normals = np.full((5, 5, 3), np.nan)
    for i in range(5):
        normals[i, 4 - i] = tilted(0.0)
    assert set(segment_sheets(normals).ravel()) == {-1, 0}
    assert (segment_sheets(np.full((5, 5, 3), np.nan)) == -1).all()


def test_means_are_those_of_each_sheet() -> None:
    sheets = segment_sheets(two_sheets())
    values = np.where(np.arange(60)[None] < 30, 2.0, np.nan) * np.ones((40, 1))
    for sd in (2.0, 100.0):
        means = sheet_means(sheets, values, sd)
        np.testing.assert_allclose(means[20, [5, 25]], 2.0, rtol=1e-6)
        np.testing.assert_allclose(means[20, [35, 50]], 0.0, atol=1e-6)
        assert np.isnan(means[0, 0])


def test_means_of_a_long_sheet_are_those_of_its_parts() -> None:
    sheets, values = np.zeros((10, 100), int), np.where(np.arange(100) < 50, 3.0, -1.0) * np.ones((10, 1))
    means = sheet_means(sheets, values, 5.0)
    np.testing.assert_allclose(means[5, [10, 90]], [3.0, -1.0], atol=1e-3)
    np.testing.assert_allclose(sheet_means(sheets, values, 60.0), 1.0)


def test_values_beside_a_sheet_do_not_enter_its_means() -> None:
    bent = np.full((80, 80), -1)
    bent[10:70, 10:14] = bent[66:70, 10:70] = 0
    values = np.where(bent == 0, 3.0, 100.0)
    np.testing.assert_allclose(sheet_means(bent, values, 5.0)[bent == 0], 3.0, rtol=1e-5)


def test_a_small_sheet_is_averaged_as_a_whole_wherever_it_lies() -> None:
    sheets = np.full((90, 90), -1)
    sheets[80:88, 70:78] = 0
    values = np.where(np.arange(90) < 74, 1.0, 2.0) * np.ones((90, 1))
    assert (sheet_means(sheets, values, 4.0)[sheets == 0] == 1.5).all()


@pytest.mark.parametrize("step", [(0, 1), (1, 0), (1, 1), (1, -1)])
def test_neighbours_on_all_sides_belong_together_but_no_pixels_farther_apart(step: tuple[int, int]) -> None:
    for distance, count in ((1, 1), (2, 2)):
        normals = np.full((7, 7, 3), np.nan)
        for pixel in range(2):
            normals[2 + pixel * distance * step[0], 3 + pixel * distance * step[1]] = tilted(0.0)
        sheets = segment_sheets(normals)
        assert len(np.unique(sheets[sheets >= 0])) == count


def test_a_sheet_a_little_longer_than_the_window_is_not_averaged_as_a_whole() -> None:
    sheets, values = np.zeros((1, 30), int), np.where(np.arange(30) < 15, 3.0, -1.0)[None]
    assert np.ptp(sheet_means(sheets, values, 15.0)) == 0.0
    assert np.ptp(sheet_means(sheets, values, 14.9)) > 1.0
