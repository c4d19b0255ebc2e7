import numpy as np
import pytest

from glint.tasks.algorithms.near_light.held_levels import held_back


def test_a_rising_level_is_shown_lower_and_a_falling_one_higher() -> None:
    levels = np.array([10.0, 11.0, 12.0, 13.0, 12.0, 11.0, 10.0])[:, None]
    assert held_back(levels, 1.0)[:, 0].tolist() == [10.0, 10.0, 11.0, 12.0, 12.0, 12.0, 11.0]


def test_without_a_slack_levels_are_shown_as_they_are() -> None:
    levels = np.random.default_rng(0).normal(size=(50, 4))
    np.testing.assert_array_equal(held_back(levels, 0.0), levels)


@pytest.mark.parametrize("slack", [0.5, 2.0])
def test_a_level_is_never_farther_off_than_the_slack_and_changes_within_it_are_lost(slack: float) -> None:
    levels = np.cumsum(np.random.default_rng(0).normal(size=(200, 3)), axis=0)
    shown = held_back(levels, slack)
    assert np.abs(shown - levels).max() <= slack + 1e-12
    trembling = np.stack([np.full(10, 5.0), 5.0 + 0.9 * slack * np.sin(np.arange(10.0))], axis=1)
    np.testing.assert_array_equal(held_back(trembling, slack), np.full((10, 2), 5.0))
