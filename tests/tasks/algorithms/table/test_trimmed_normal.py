import numpy as np
import pytest

from glint.tasks.algorithms.table.trimmed_normal import squared_distance, trimmed_normal


def test_outliers_do_not_move_the_distribution() -> None:
    generator = np.random.default_rng(0)
    expected = np.array([[4.0, 1.0], [1.0, 0.5]])
    samples = generator.multivariate_normal([3.0, -1.0], expected, 20_000)
    samples[:400] = 100.0
    mean, covariance = trimmed_normal(samples)
    assert mean == pytest.approx([3.0, -1.0], abs=0.05)
    assert covariance == pytest.approx(expected, rel=0.15)


def test_the_tail_that_is_cut_off_is_made_up_for() -> None:
    samples = np.random.default_rng(0).normal(0.0, 2.0, (40_000, 2))
    assert np.diag(trimmed_normal(samples)[1]) == pytest.approx([4.0, 4.0], rel=0.04)


def test_distances_are_in_standard_deviations() -> None:
    offsets = np.array([[2.0, 0.0], [0.0, 3.0], [2.0, 3.0]])
    assert squared_distance(offsets, np.diag([4.0, 9.0])) == pytest.approx([1.0, 1.0, 2.0])


def test_constant_samples_have_a_distribution() -> None:
    mean, covariance = trimmed_normal(np.full((60, 2), 5.0))
    assert mean == pytest.approx([5.0, 5.0]) and (np.linalg.eigvalsh(covariance) > 0.0).all()
