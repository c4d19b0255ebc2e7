"""The robust standard deviation."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.robust import GAUSSIAN_RATIO, robust_deviation


def test_outliers_do_not_move_the_deviation() -> None:
    residuals = np.random.default_rng(4).normal(0.0, 3.0, 20_000)
    assert robust_deviation(residuals) == pytest.approx(3.0, rel=0.03)
    residuals[:1000] = 1e6
    assert robust_deviation(residuals) == pytest.approx(3.0, rel=0.1)


def test_the_deviation_is_that_about_zero() -> None:
    assert robust_deviation(np.array([2.0, 2.0, 2.0, -2.0])) == 2.0 * GAUSSIAN_RATIO
