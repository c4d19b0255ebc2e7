import numpy as np

from glint.tasks.algorithms.revolution.periodic_normals import held_out_errors, sampled, sums_over_periods

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


def test_other_periods_predict_what_repeats_and_circles_what_does_not_turn() -> None:
    row, turns = places(20_000)
    by_place, by_circle = held_out_errors(row, turns, tilted(0.3 * np.sin(2.0 * np.pi * turns)), ROWS, COLUMNS, 20.0)
    assert np.isfinite(by_place).all()
    assert np.sqrt(by_place.mean()) < 1.0
    assert abs(np.sqrt(by_circle.mean()) - np.degrees(0.3 / np.sqrt(2.0))) < 0.5
    # What repeats after two periods only is the opposite in the next.
    by_place, _ = held_out_errors(row, turns, tilted(0.3 * np.sin(np.pi * turns)), ROWS, COLUMNS, 20.0)
    assert np.sqrt(by_place.mean()) > 10.0


def test_nothing_is_predicted_where_no_other_period_was_seen() -> None:
    row, turns = places(2_000)
    by_place, by_circle = held_out_errors(row, turns % 1.0, tilted(0.0 * turns), ROWS, COLUMNS, 20.0)
    assert np.isnan(by_place).all() and np.isnan(by_circle).all()
