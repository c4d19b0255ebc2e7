import numpy as np
import pytest

from glint.tasks.algorithms.table.table_model import fit_table

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
