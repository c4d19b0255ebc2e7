import numpy as np

from glint.tasks.algorithms.revolution.periodic_normals import repeated_candidates, sampled, sums_over_periods

ROWS, COLUMNS = 40, 30


def places(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return circles (N,) and turns (N,) of random points on six periods."""
    generator = np.random.default_rng(0)
    return generator.integers(0, ROWS, count), generator.uniform(-3.0, 3.0, count)


def tilted(angle: np.ndarray) -> np.ndarray:
    """Return normals (N, 3) turned by angles (N,), radians, from the radius along the circle."""
    return np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])


def test_sums_of_what_repeats_say_it_everywhere() -> None:
    row, turns = places(20_000)
    sums = sums_over_periods(row, turns, tilted(0.3 * np.sin(2.0 * np.pi * turns)), ROWS, COLUMNS)
    asked = np.linspace(-3.0, 3.0, 200)
    normals, support = sampled(sums, np.full(200, 20), asked)
    expected = 0.3 * np.sin(2.0 * np.pi * asked)
    assert np.abs(np.arctan2(normals[:, 1], normals[:, 0]) - expected).max() < np.radians(1.0)
    assert abs(float(support.mean()) / (20_000 / (ROWS * COLUMNS)) - 1.0) < 0.05


def repeated(turns: np.ndarray, row: np.ndarray, candidates: np.ndarray, shift: int = 0) -> np.ndarray:
    """Return the number (N,) of each pixel's repeated candidate."""
    return repeated_candidates(row, turns, candidates, ROWS, COLUMNS, shift, 0.4, np.arange(len(turns)))[0]


def test_the_candidate_that_other_periods_show_repeats() -> None:
    row, turns = places(20_000)
    generator = np.random.default_rng(1)
    true, false = tilted(0.6 * np.sin(2.0 * np.pi * turns)), tilted(generator.uniform(-1.2, 1.2, 20_000))
    is_first = generator.random(20_000) < 0.5
    candidates = np.stack([np.where(is_first[:, None], true, false), np.where(is_first[:, None], false, true)])
    number = repeated(turns, row, candidates)
    assert (number == np.where(is_first, 0, 1)).mean() > 0.96
    # A third of a period further most of the true ones are others.
    assert (repeated(turns, row, candidates, COLUMNS // 3) >= 0).mean() < 0.25
    # What repeats after two periods only is the opposite in the next.
    halved = tilted(0.6 * np.sin(np.pi * turns))[None]
    assert (repeated(turns, row, halved) >= 0).mean() < 0.7 * (repeated(turns / 2.0, row, halved) >= 0).mean()


def test_nothing_repeats_where_no_other_period_was_seen() -> None:
    row, turns = places(2_000)
    assert (repeated(turns % 1.0, row, tilted(0.0 * turns)[None]) == -1).all()


def test_gaps_are_no_candidates() -> None:
    row, turns = places(2_000)
    assert (repeated(turns, row, np.full((2, 2_000, 3), np.nan)) == -1).all()
