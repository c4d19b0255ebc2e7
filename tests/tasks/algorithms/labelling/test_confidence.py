import numpy as np
import pytest

from glint.tasks.algorithms.geometry.distance import distance_inside
from glint.tasks.algorithms.labelling.confidence import (
    MAX_ACCEPTED_ODDS,
    MIN_DISTANCE_PX,
    OCCLUDING_CONTOUR_SHARE,
    OWN_ERROR_DEG,
    RAYLEIGH_NINTH_DECILE,
    accepted_log_odds,
    field_confidence,
    field_error_slope,
    observed_confidence,
    place_confidence,
    probability_within_tolerance,
    sheet_confidence,
    with_input_doubt,
)


def plane(size: int = 60) -> np.ndarray:
    normals = np.zeros((size, size, 3))
    normals[..., 2] = 1.0
    return normals


def test_the_probability_matches_a_simulation() -> None:
    errors = np.hypot(*np.random.default_rng(0).normal(0, np.radians(3.0), (2, 200_000)))
    assert abs(probability_within_tolerance(np.radians(3.0)) - (errors < np.radians(5)).mean()) < 0.01


def test_dense_smooth_sheets_have_more_confidence_than_scraps_noise_and_curl() -> None:
    dense = np.nanmedian(observed_confidence(plane(), 30.0))
    scrap = plane()
    scrap[np.random.default_rng(0).random((60, 60)) < 0.9] = np.nan
    noisy = plane() + np.random.default_rng(0).normal(0, 0.15, (60, 60, 3))
    noisy /= np.linalg.norm(noisy, axis=-1, keepdims=True)
    rows, columns = (np.indices((60, 60)) - 30) / 100
    curled = np.stack([rows, columns, np.ones((60, 60))], axis=-1)
    curled /= np.linalg.norm(curled, axis=-1, keepdims=True)
    assert dense > 0.95
    for worse in (scrap, noisy, curled):
        assert np.nanmedian(observed_confidence(worse, 30.0)) < dense - 0.02


def test_a_sheet_of_odd_shape_or_large_residual_is_not_confident() -> None:
    even = np.zeros((60, 60))
    confidence = sheet_confidence(plane(), even + 2.0, even + 0.5, 30.0, 0.0)
    assert confidence.min() > 0.97
    for shape, residual in ((0.0, 2.0), (-1.0, 1.0), (2.0, 3.5)):
        assert sheet_confidence(plane(), even + shape, even + residual, 30.0, 0.0).max() < 0.95
    absent = np.full((60, 60, 3), np.nan)
    assert np.isnan(sheet_confidence(absent, even, even, 30.0, 0.0)).all()


def test_sheets_of_an_object_whose_highlights_are_mostly_false_are_not_confident() -> None:
    even, has_candidate = np.zeros((60, 60)), np.ones((60, 60), dtype=bool)
    confidence = []
    for share in (0.05, 0.5, 0.8):
        accepted = np.zeros((60, 60), dtype=bool)
        accepted[: int(60 * share)] = True
        odds = accepted_log_odds(accepted, has_candidate)
        assert abs(odds - np.log(share / (1.0 - share))) < 1e-9
        confidence.append(float(sheet_confidence(plane(), even + 1.0, even + 1.0, 30.0, odds).max()))
    assert confidence[0] < 0.7 < 0.95 < confidence[1] < confidence[2]


def test_an_object_without_false_highlights_and_one_without_accepted_ones_have_finite_odds() -> None:
    none, every = np.zeros((60, 60), dtype=bool), np.ones((60, 60), dtype=bool)
    assert accepted_log_odds(every, every) == np.log(MAX_ACCEPTED_ODDS)
    assert accepted_log_odds(none, every) < -10.0
    # What never showed a highlight says nothing of the false ones.
    half = np.indices((60, 60))[0] < 30
    assert accepted_log_odds(half, half) == accepted_log_odds(every, every)


def test_where_the_surface_turns_from_pixel_to_pixel_a_normal_is_known_no_better_than_its_place() -> None:
    generator = np.random.default_rng(0)
    # Student's t in the plane: a normal vector over the root of an independent chi-square per degree of freedom.
    places = 0.14 * generator.normal(size=(2, 200_000)) / np.sqrt(generator.chisquare(2, 200_000) / 2.0)
    for turn_deg in (0.5, 2.0, 7.0, 15.0):
        y, x = np.radians(turn_deg) * (np.indices((5, 5)) - 2.0)
        dome = np.stack([x, y, np.ones((5, 5))], axis=-1)
        dome /= np.linalg.norm(dome, axis=-1, keepdims=True)
        right = (turn_deg * np.hypot(*places) < 5.0).mean()
        assert abs(place_confidence(dome)[2, 2] - right) < 0.01


def test_ridges_are_judged_alike_in_any_direction() -> None:
    angle = np.radians(9.0) * (np.arange(5) - 2.0)
    ridge = np.tile(np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=-1), (5, 1, 1))
    assert 0.9 < place_confidence(ridge)[2, 2] < 0.95
    assert abs(place_confidence(ridge.swapaxes(0, 1))[2, 2] - place_confidence(ridge)[2, 2]) < 1e-9


def test_a_place_within_a_pixel_is_no_doubt_of_planes_and_beyond_the_object() -> None:
    half = plane(20)
    half[:, 10:] = np.nan
    assert place_confidence(half).min() > 1.0 - 1e-6


def test_an_error_that_half_vectors_share_adds_to_the_normals_own() -> None:
    generator = np.random.default_rng(2)
    own, shared = np.radians(OWN_ERROR_DEG), np.radians(1.7)
    errors = np.linalg.norm(generator.normal(0.0, own, (200_000, 2)), axis=1)
    both = np.linalg.norm(generator.normal(0.0, np.hypot(own, shared), (200_000, 2)), axis=1)
    expected = 0.97 * (both < np.radians(5.0)).mean() / (errors < np.radians(5.0)).mean()
    confidence = with_input_doubt(np.full(1, 0.97), np.full(1, shared), np.zeros(1))
    assert confidence[0] == pytest.approx(expected, abs=0.003)
    assert with_input_doubt(np.full(1, 0.97), np.zeros(1), np.zeros(1))[0] == pytest.approx(0.97)
    assert with_input_doubt(np.full(1, 0.97), np.zeros(1), np.full(1, 0.5))[0] == pytest.approx(0.485)


def test_the_slope_is_that_of_the_held_out_blocks() -> None:
    normals = plane()
    exact = field_error_slope(lambda known: normals, normals, 30.0)
    tilt = np.radians(20.0)
    wrong = np.broadcast_to(np.array([np.sin(tilt), 0.0, np.cos(tilt)]), normals.shape)
    assert exact < 1e-6 < field_error_slope(lambda known: wrong, normals, 30.0)
    assert field_error_slope(lambda known: normals, np.full_like(normals, np.nan), 30.0) > np.radians(1.0)


def test_the_slope_is_the_growth_of_the_error_with_the_distance_from_what_is_kept() -> None:
    normals, slope = plane(), np.radians(0.4)
    kept_blocks = []

    def predict(kept: np.ndarray) -> np.ndarray:
        kept_blocks.append(kept)
        error = slope * (distance_inside(~kept) + MIN_DISTANCE_PX)
        return np.stack([np.sin(error), np.zeros(kept.shape), np.cos(error)], axis=-1)

    assert field_error_slope(predict, normals, 30.0) == pytest.approx(slope / RAYLEIGH_NINTH_DECILE, rel=1e-5)
    assert (kept_blocks[0] ^ kept_blocks[1]).all()


def test_between_accepted_normals_and_contour_the_field_is_as_sure_as_its_error_allows() -> None:
    known, rim = np.zeros((2, 60, 60), dtype=bool)
    rim[:, 0] = True
    slope = np.radians(0.3)
    alone = field_confidence(known, rim, slope, 30.0)
    within = probability_within_tolerance(slope * (np.arange(60) + MIN_DISTANCE_PX))
    np.testing.assert_allclose(alone[30], OCCLUDING_CONTOUR_SHARE * within, rtol=1e-5)
    everywhere = field_confidence(~known, rim, slope, 30.0)
    np.testing.assert_allclose(everywhere, probability_within_tolerance(slope * MIN_DISTANCE_PX), rtol=1e-5)


def test_the_field_is_less_confident_at_a_distance_and_near_the_contour() -> None:
    known, rim = np.zeros((2, 80, 80), dtype=bool)
    known[:, :40] = True
    known[:, 20:22] = False
    rim[:, 79] = True
    confidence = field_confidence(known, rim, np.radians(0.1), 30.0)
    assert confidence[40, 20] > 0.95 > confidence[40, 45] > confidence[40, 60]
    assert field_confidence(known & False, rim & False, 0.1, 30.0).max() == 0.0
