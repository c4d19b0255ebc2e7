"""Errors whose size is known."""

import numpy as np
import pytest

from glint.tasks.algorithms.evaluation.metrics import depth_errors, label_errors, normal_errors, reliability


def test_a_tilt_is_measured() -> None:
    truth = np.tile([0.0, 0.0, 1.0], (6, 5, 1))
    tilt = np.radians(10.0)
    estimated = np.tile([np.sin(tilt), 0.0, np.cos(tilt)], (6, 5, 1))
    estimated[0, 0] = truth[0, 1] = np.nan
    errors = normal_errors(estimated, truth, np.ones((6, 5), bool))
    assert errors.mean == errors.median == pytest.approx(10.0)
    assert errors.squared == pytest.approx(2 - 2 * np.cos(tilt))
    assert errors.within == (0.0, 1.0, 1.0) and (errors.pixels, errors.missing) == (29, 1)


def test_nothing_to_compare_is_refused() -> None:
    with pytest.raises(ValueError, match="no pixel"):
        normal_errors(np.ones((2, 2, 3)), np.full((2, 2, 3), np.nan), np.ones((2, 2), bool))
    with pytest.raises(ValueError, match="fit"):
        normal_errors(np.ones((2, 2, 3)), np.ones((2, 3, 3)), np.ones((2, 2), bool))


def test_each_component_of_depth_has_its_own_offset() -> None:
    mask = np.ones((8, 9), bool)
    mask[:, 4] = False
    truth = np.fromfunction(lambda y, x: 0.5 * x + y, (8, 9))
    estimated = truth.copy()
    estimated[:, :4] += 100.0
    assert depth_errors(estimated, truth, mask).mean == pytest.approx(0.0)
    estimated[0, 0] += 3.0
    errors = depth_errors(estimated, truth, mask)
    assert errors.mean == pytest.approx(3.0 / 64) and errors.rms == pytest.approx(np.sqrt(9 / 64))


def test_depth_is_related_to_the_size_of_the_object_and_missing_depth_is_counted() -> None:
    truth = np.zeros((4, 5))
    truth[0, 0] = np.nan
    estimated = np.tile([1.0, -1.0], 10).reshape(4, 5)
    estimated[3, 4] = np.nan
    errors = depth_errors(estimated, truth, np.ones((4, 5), bool))
    assert errors.missing == 1
    assert errors.relative == pytest.approx(errors.mean / np.hypot(4, 5))


def test_depth_that_cannot_be_compared_is_refused() -> None:
    with pytest.raises(ValueError, match="fit"):
        depth_errors(np.ones((2, 2)), np.ones((2, 3)), np.ones((2, 3), bool))
    with pytest.raises(ValueError, match="no pixel"):
        depth_errors(np.full((2, 2), np.nan), np.ones((2, 2)), np.ones((2, 2), bool))


def test_labels_have_precision_and_recall() -> None:
    up, aslant = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    truth = np.broadcast_to(up, (1, 4, 3))
    candidates = np.stack([[[up, up, aslant, aslant]], [[aslant, aslant, up, np.full(3, np.nan)]]])
    labels = np.array([[[1, 0, 1, 1]], [[0, 0, 0, 0]]])
    errors = label_errors(labels, candidates, truth)
    assert errors.precision == pytest.approx(1 / 3)
    assert errors.recall == pytest.approx(1 / 3)
    assert np.isnan(label_errors(np.zeros_like(labels), candidates, truth).precision)


def test_confidence_is_compared_with_the_share_that_is_right() -> None:
    up, aslant = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    truth = np.broadcast_to(up, (1, 5, 3))
    normals = np.array([[up, up, up, aslant, aslant]])
    confidence = np.array([[0.97, 1.0, 0.52, 0.55, np.nan]])
    low, high = reliability(confidence, normals, truth)
    assert (low.low, low.pixels, low.right) == (0.5, 2, 0.5)
    assert low.confidence == pytest.approx(0.535)
    assert (high.low, high.pixels, high.right) == (0.95, 2, 1.0)
