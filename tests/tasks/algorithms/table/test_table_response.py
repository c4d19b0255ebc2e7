"""Response of a table, of what follows the light otherwise, and of flashes."""

import numpy as np
import pytest

from glint.tasks.algorithms.table.table_response import (
    COMPONENTS,
    LEAST_RESIDUAL,
    LargestFlashes,
    brightness,
    table_response,
)

SHAPE = (60, 80)


def table_frames(count: int = 64, noise: float = 2.0) -> np.ndarray:
    """Return frames (T, H, W) uint8 of a table with noise, under a light that goes up and down."""
    levels = 80.0 + 30.0 * np.cos(np.arange(count) / 3.0)
    frames = levels[:, None, None] + np.random.default_rng(0).normal(0.0, noise, (count, *SHAPE))
    return np.rint(frames).astype(np.uint8)


def test_the_deviation_is_relative_to_the_residual_of_the_table_and_no_less_than_rounding_hides() -> None:
    frames = table_frames()
    frames[:, 25:30, 30:35] = 0
    frames[1::2, 35:40, 50:55] += 20
    frames[::2, 35:40, 50:55] -= 20
    response = table_response(frames, np.ones(SHAPE, bool))
    assert np.median(response.deviation[10:20, 10:70]) == pytest.approx(0.0, abs=0.05)
    assert response.deviation[27, 32] == pytest.approx(np.log(LEAST_RESIDUAL / np.sqrt(response.noise.constant)))
    # What alternates by 20 levels, of which the table follows nothing, against a noise of 2.
    assert response.deviation[37, 52] == pytest.approx(np.log(10.0), abs=0.2)


def test_the_residual_is_a_mean_over_the_frames() -> None:
    response = table_response(table_frames(noise=3.0), np.ones(SHAPE, bool))
    assert response.noise.log_ratio(np.full(1, 3.0), np.full(1, 80.0)) == pytest.approx(0.0, abs=0.1)


def test_the_second_largest_flash_counts_and_the_moment_is_that_of_the_largest() -> None:
    flashes = LargestFlashes((40, 60))
    for number, levels in enumerate([(60.0, 100.0), (0.0, 20.0), (100.0, 60.0), (30.0, 0.0)]):
        residual = np.zeros((40, 60), np.float32)
        residual[20, 20], residual[20, 40] = levels
        flashes.add(residual, number)
    assert flashes.second[20, [20, 40]] == pytest.approx([60.0, 60.0], rel=0.05)
    assert flashes.moment[20, 20] == 2 and flashes.moment[20, 40] == 0


def test_what_changes_over_a_wide_area_or_is_not_used_is_no_flash() -> None:
    flashes, residual = LargestFlashes((40, 40)), np.full((40, 40), 50.0, np.float32)
    residual[10, 10] = residual[30, 30] = 150.0
    used = np.ones((40, 40), bool)
    used[30, 30] = False
    for number in range(2):
        flashes.add(residual, number, used)
    assert flashes.second[10, 10] == pytest.approx(100.0, rel=0.05)
    assert flashes.second[30, 30] == 0.0 and flashes.second[20, 20] == pytest.approx(0.0, abs=0.1)


def test_brightness_is_in_levels() -> None:
    basis = np.full((25, 1), 1.0 / 5.0)
    amplitudes = basis[:, 0] @ np.full((25, 3), [40.0, 90.0, -10.0])
    assert brightness(amplitudes, basis) == pytest.approx([40.0, 90.0, 10.0])


def test_spheres_are_no_table() -> None:
    frames, free = table_frames(), np.ones(SHAPE, bool)
    free[:, :20] = False
    frames[:, ~free] = np.random.default_rng(1).integers(0, 255, (64, (~free).sum()))
    response = table_response(frames, free)
    assert not response.border[~free].any() and response.border[0, 40]
    assert np.median(response.deviation[20:40, 40:60]) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("count", "components"), [(3, 1), (8, 2), (40, COMPONENTS)])
def test_few_frames_have_few_components_and_their_background_is_the_lower_of_two(count: int, components: int) -> None:
    frames = table_frames(count)
    frames[:, 30, 40] = np.where(np.arange(count) < (count + 1) // 2, 10, 200)
    response = table_response(frames, np.ones(SHAPE, bool))
    assert response.basis.shape == (count, components)
    assert response.background[30, 40] == 10.0
