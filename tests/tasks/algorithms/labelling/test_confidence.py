import numpy as np

from glint.tasks.algorithms.labelling.confidence import (
    field_confidence,
    field_growth,
    observed_confidence,
    sheet_confidence,
    within_tolerance,
)


def plane(size: int = 60) -> np.ndarray:
    normals = np.zeros((size, size, 3))
    normals[..., 2] = 1.0
    return normals


def test_within_tolerance_matches_a_simulation() -> None:
    errors = np.hypot(*np.random.default_rng(0).normal(0, np.radians(3.0), (2, 200_000)))
    assert abs(within_tolerance(np.radians(3.0)) - (errors < np.radians(5)).mean()) < 0.01


def test_dense_smooth_sheets_are_surer_than_scraps_noise_and_curl() -> None:
    dense = np.nanmedian(observed_confidence(plane(), 30.0))
    scrap = plane()
    scrap[np.random.default_rng(0).random((60, 60)) < 0.9] = np.nan
    noisy = plane() + np.random.default_rng(0).normal(0, 0.15, (60, 60, 3))
    noisy /= np.linalg.norm(noisy, axis=-1, keepdims=True)
    rows, columns = (np.indices((60, 60)) - 30) / 100
    curled = np.stack([rows, columns * 0 - columns * -1.0, np.ones((60, 60))], axis=-1)
    curled /= np.linalg.norm(curled, axis=-1, keepdims=True)
    assert dense > 0.95
    for worse in (scrap, noisy, curled):
        assert np.nanmedian(observed_confidence(worse, 30.0)) < dense - 0.02


def test_a_sheet_of_odd_shape_or_place_is_not_sure() -> None:
    even = np.zeros((60, 60))
    sure = sheet_confidence(plane(), even + 2.0, even + 0.5, 30.0)
    assert sure.min() > 0.97
    for shape, told in ((0.0, 2.0), (-1.0, 1.0), (2.0, 3.5)):
        assert sheet_confidence(plane(), even + shape, even + told, 30.0).max() < 0.95
    gone = np.full((60, 60, 3), np.nan)
    assert np.isnan(sheet_confidence(gone, even, even, 30.0)).all()


def test_growth_is_what_the_withheld_blocks_show() -> None:
    normals = plane()
    exact = field_growth(lambda known: normals, normals, 30.0)
    tilt = np.radians(20.0)
    wrong = np.broadcast_to(np.array([np.sin(tilt), 0.0, np.cos(tilt)]), normals.shape)
    assert exact < 1e-6 < field_growth(lambda known: wrong, normals, 30.0)
    assert field_growth(lambda known: normals, np.full_like(normals, np.nan), 30.0) > np.radians(1.0)


def test_the_field_is_less_sure_far_away_and_towards_a_rim() -> None:
    known, rim = np.zeros((2, 80, 80), dtype=bool)
    known[:, :40] = True
    known[:, 20:22] = False
    rim[:, 79] = True
    confidence = field_confidence(known, rim, np.radians(0.1), 30.0)
    assert confidence[40, 20] > 0.95 > confidence[40, 45] > confidence[40, 60]
    assert field_confidence(known & False, rim & False, 0.1, 30.0).max() == 0.0
