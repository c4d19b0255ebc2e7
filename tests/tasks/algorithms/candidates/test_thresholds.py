import numpy as np
import pytest

from glint.tasks.algorithms.candidates.lit_frames import BRIGHT_RISE, SPARSE_RISE
from glint.tasks.algorithms.candidates.thresholds import (
    highlight_levels,
    highlight_thresholds,
    least_rise,
    saturation_level,
)
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.simulation.light_path import light_path


def test_thresholds_rise_with_the_picture_behind_the_glass() -> None:
    background = np.array([[0, 100, 200]], np.uint8)
    np.testing.assert_array_equal(highlight_thresholds(background, 255.0, 0.8), [[204, 224, 244]])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_what_is_saturated_without_the_light_never_counts_as_lit(dtype: type[np.unsignedinteger]) -> None:
    limit = np.iinfo(dtype).max
    background = (limit * np.array([[0.98, 0.99, 1.0]])).astype(dtype)
    thresholds = highlight_thresholds(background, float(limit), 0.85)
    assert thresholds.dtype == dtype and (thresholds >= background).all()
    assert (thresholds[0, 1:] == limit).all()


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


def swept(frames: int) -> np.ndarray:
    """Return the half vectors (frames, 3) of a light that is moved by hand."""
    return half_vectors_of(light_path(frames, np.random.default_rng(0)))


def test_dim_highlights_count_where_the_lights_are_sparse() -> None:
    assert least_rise(swept(4000)) == BRIGHT_RISE
    assert least_rise(swept(500)) == SPARSE_RISE
    assert SPARSE_RISE < least_rise(swept(950)) < BRIGHT_RISE


def test_photographs_have_bright_highlights_only() -> None:
    assert least_rise(swept(99)) == BRIGHT_RISE
    assert least_rise(np.full((3, 3), np.nan)) == BRIGHT_RISE


def test_a_sweep_that_surrounds_no_observable_normal_has_bright_highlights_only() -> None:
    assert least_rise(np.tile([np.sin(np.radians(50.0)), 0.0, np.cos(np.radians(50.0))], (200, 1))) == BRIGHT_RISE


def test_a_light_that_lingers_is_as_sparse_as_it_was() -> None:
    half_vectors = swept(500)
    assert least_rise(np.concatenate([half_vectors, np.repeat(half_vectors[:1], 5000, axis=0)])) == SPARSE_RISE


def test_rejected_frames_do_not_make_the_lights_dense() -> None:
    half_vectors = swept(4000)
    half_vectors[np.arange(4000) % 8 != 0] = np.nan
    assert least_rise(half_vectors) < BRIGHT_RISE


def test_levels_follow_from_background_peak_and_lights() -> None:
    background, peak = np.full((2, 2), 55, np.uint8), np.full((2, 2), 255, np.uint8)
    mask = np.array([[True, True], [True, False]])
    sparse, given = highlight_levels(background, peak, mask, swept(500)), 0.75
    assert sparse.saturation == 255 and sparse.least_rise == SPARSE_RISE
    np.testing.assert_array_equal(sparse.thresholds, [[185, 185], [185, 255]])
    chosen = highlight_levels(background, peak, mask, swept(500), given)
    assert chosen.least_rise == given and chosen.thresholds[0, 0] == 205
