import numpy as np
import pytest

from glint.tasks.algorithms.candidates.thresholds import highlight_thresholds, saturation_level
from glint.tasks.algorithms.errors import UnusableCapture


def test_thresholds_rise_with_the_picture_behind_the_glass() -> None:
    background = np.array([[0, 100, 200]], np.uint8)
    np.testing.assert_array_equal(highlight_thresholds(background, 255.0, 0.8), [[204, 224, 244]])
    assert (highlight_thresholds(np.full((1, 1), 254, np.uint8), 255.0) < 256).all()


def test_an_object_without_highlights_has_no_saturation_level() -> None:
    dark = np.full(100, 20, np.uint8)
    assert saturation_level(np.full(100, 240, np.uint8), dark) == 240
    with pytest.raises(UnusableCapture, match="shows no highlights"):
        saturation_level(dark + 5, dark)
    with pytest.raises(UnusableCapture, match="saturated"):
        saturation_level(np.full(100, 255, np.uint8), np.full(100, 255, np.uint8))


def test_few_highlights_set_the_level_and_not_the_shading_around_them() -> None:
    peak = np.full(10_000, 150, np.uint8)
    peak[:30] = 250
    assert saturation_level(peak, np.full(10_000, 90, np.uint8)) == 250
