import numpy as np
import pytest

from glint.tasks.algorithms.table.table_model import MAX_LOCAL_VARIANCE, MIN_SPREAD, fit_table

SIZE = 80


def responses(low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return log responses (H, W, 2) of a table whose flashes are `low` on its left half and `high` on its right, with
    an object's in its middle, and which pixels are the table's border and the object's."""
    generator = np.random.default_rng(0)
    features = generator.normal(0.0, 0.15, (SIZE, SIZE, 2)).astype(np.float32)
    features[:, : SIZE // 2, 1] += low
    features[:, SIZE // 2 :, 1] += high
    is_border, is_object = np.ones((SIZE, SIZE), bool), np.zeros((SIZE, SIZE), bool)
    is_border[6:-6, 6:-6], is_object[30:50, 30:50] = False, True
    features[is_object] = 2.5
    return features, is_border, is_object


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (-0.7, 0.5)])
def test_highlights_stand_out_from_every_part_of_the_table(low: float, high: float) -> None:
    features, is_border, is_object = responses(low, high)
    flashing = fit_table(features, is_border, None).flashing(features)
    assert flashing[is_object].all()
    assert not flashing[~is_object].any()


def test_areas_tell_the_object_where_the_table_flashes_nearly_as_strongly() -> None:
    generator = np.random.default_rng(1)
    features, is_border, is_object = responses(0.0, 0.0)
    features[..., 1] += generator.normal(0.0, 0.7, (SIZE, SIZE))
    features[is_object, 1] = generator.normal(2.0, 0.5, int(is_object.sum()))
    table = fit_table(features, is_border, None)
    assert (features[is_object, 1] > table.flash_limit).mean() < 0.01
    flashing = table.flashing(features)
    assert flashing[32:48, 32:48].all()
    assert flashing[~is_object].mean() < 0.01


def test_areas_do_not_count_where_single_pixels_tell() -> None:
    features, is_border, _ = responses(0.0, 0.0)
    assert np.isinf(fit_table(features, is_border, None).area_limit)


def test_the_table_is_expected_as_it_is_nearby_and_far_from_it_as_all_of_it() -> None:
    rows, columns = np.mgrid[:SIZE, : 3 * SIZE].astype(np.float32)
    features = np.random.default_rng(2).normal(0.0, 0.05, (SIZE, 3 * SIZE, 2)).astype(np.float32)
    features[..., 0] += 3.0 + np.where(columns < SIZE, rows / SIZE - 0.5, 0.0)
    is_table = columns < SIZE
    is_table[24:56, 24:56] = False
    mean = fit_table(features, is_table, 30.0).mean[..., 0]
    assert mean[10, 10:70] == pytest.approx(3.0 + 10 / SIZE - 0.5, abs=0.1)
    assert mean[40, 40] == pytest.approx(3.0, abs=0.1)
    assert mean[40, -1] == pytest.approx(3.0, abs=0.1)


def test_inside_the_object_the_table_is_expected_as_around_its_nearer_side() -> None:
    features = np.random.default_rng(2).normal(0.0, 0.05, (SIZE, SIZE, 2)).astype(np.float32)
    features[..., 0] += np.arange(SIZE, dtype=np.float32)[:, None] / SIZE - 0.5
    is_table = np.ones((SIZE, SIZE), bool)
    is_table[16:64, 16:64] = False
    upper, middle, lower = fit_table(features, is_table, 30.0).mean[[28, 40, 52], 40, 0]
    assert upper < -0.1 and abs(middle) < 0.05 and lower > 0.1


def test_where_the_table_spreads_more_a_difference_weighs_less_and_nowhere_more() -> None:
    features = np.random.default_rng(3).normal(0.0, 0.15, (SIZE, SIZE, 2)).astype(np.float32)
    features[20:28, 20:28] *= 3.0
    features[52:60, 52:60] *= 8.0
    table = fit_table(features, np.ones((SIZE, SIZE), bool), 40.0)
    distance = table.distance(table.mean + 1.0)
    assert distance[24, 24] < 0.5 * distance[24, 60]
    assert table.variance.min() == 1.0 and table.variance.max() == pytest.approx(MAX_LOCAL_VARIANCE)


def test_the_least_spread_makes_small_differences_of_an_even_table_no_evidence() -> None:
    table = fit_table(np.zeros((SIZE, SIZE, 2), np.float32), np.ones((SIZE, SIZE), bool), None)
    assert table.distance(np.array([[[MIN_SPREAD, 0.0]]])) == pytest.approx(1.0, abs=0.02)
