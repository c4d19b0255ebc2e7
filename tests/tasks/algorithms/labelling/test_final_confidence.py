from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.faces.flat_faces import FlatFaces
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.confidence import FACE_CONFIDENCE, OCCLUDING_CONTOUR_SHARE
from glint.tasks.algorithms.labelling.final_confidence import (
    SMALL_SHEET_RESIDUAL,
    final_confidence,
    held_out_residual,
)
from glint.tasks.algorithms.labelling.reconstruction import settle
from glint.tasks.algorithms.labelling.results import blended_normals
from glint.tasks.algorithms.labelling.weights import FieldError
from glint.tasks.algorithms.sheets.segments import segment_sheets
from tests.tasks.algorithms.labelling.scenes import SHEETS_ALONE, pebble
from tests.tasks.algorithms.sheets.two_sheets import tilted, two_sheets


def test_a_sheet_that_the_rest_of_the_object_contradicts_has_a_large_residual() -> None:
    normals = two_sheets()
    sheets, known = segment_sheets(normals), np.isfinite(normals[..., 0])
    predicted = []

    def predict(kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        predicted.append(kept)
        return np.broadcast_to(tilted(0.0), normals.shape), FieldError(ceiling=np.inf).spread(kept, 20.0)

    residual = held_out_residual(sheets, normals, known, np.ones((40, 60), dtype=bool), 3.0, predict)
    assert residual[20, 5] < 1e-3
    assert residual[20, 50] > 0.6
    assert residual[35, 10] == SMALL_SHEET_RESIDUAL
    assert np.isnan(residual[0, 0])
    assert len(predicted) == 2
    assert not predicted[0][20, 5]
    assert predicted[0][20, 50]
    assert not predicted[1][20, 50]


@pytest.mark.parametrize("size", [60, 400])
def test_the_only_sheet_of_an_object_without_contour_is_no_better_than_a_small_one(size: int) -> None:
    normals, mask = np.broadcast_to(tilted(0.0), (size, size, 3)), np.ones((size, size), bool)

    def predict(kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return normals, FieldError(ceiling=np.inf).spread(kept, size / 2.0)

    residual = held_out_residual(np.zeros((size, size), int), normals, mask, mask, size / 20.0, predict)
    assert (residual == SMALL_SHEET_RESIDUAL).all()


def test_the_part_of_a_sheet_that_the_rest_contradicts_has_a_large_residual_alone() -> None:
    normals = np.broadcast_to(tilted(0.0), (20, 120, 3))
    sheets, mask = np.zeros((20, 120), int), np.ones((20, 120), bool)
    field = np.where(np.arange(120)[None, :, None] < 80, tilted(0.0), tilted(15.0)) * np.ones((20, 1, 1))

    def predict(kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return field, np.full(kept.shape, np.radians(5.0))

    residual = held_out_residual(sheets, normals, mask, mask, 4.0, predict)
    assert residual[:, :60].max() < 0.01
    np.testing.assert_allclose(residual[:, 100:], 3.0, atol=0.1)


@pytest.fixture(scope="module")
def settled() -> Alternation:
    clusters, mask, _ = pebble(60)
    return settle(clusters, mask, SHEETS_ALONE)


def test_between_accepted_normals_that_can_be_trusted_the_field_is_surer_than_by_the_contour_alone(
    settled: Alternation,
) -> None:
    confidence = final_confidence(settled, blended_normals(settled.values, settled.smooth))
    mask, accepted = settled.view.mask, np.isfinite(settled.confidence)
    assert confidence[mask].min() >= 0.0 and confidence[mask].max() <= 1.0
    assert confidence[mask & ~accepted].max() > OCCLUDING_CONTOUR_SHARE
    doubted = copy(settled)
    doubted.options = replace(settled.options, min_confidence=1.1)
    unsure = final_confidence(doubted, blended_normals(settled.values, settled.smooth))
    assert unsure[mask & ~accepted].max() <= OCCLUDING_CONTOUR_SHARE
    np.testing.assert_array_equal(unsure[accepted], confidence[accepted])


def test_candidates_that_are_seen_through_a_face_are_not_counted_as_false(settled: Alternation) -> None:
    normals, through = blended_normals(settled.values, settled.smooth), copy(settled)
    through.seen_through = np.isfinite(settled.view.normals[..., 0]) & ~settled.labels
    accepted = settled.labels.any(axis=0)
    before, after = (final_confidence(state, normals)[accepted] for state in (settled, through))
    assert (after >= before).all() and (after > before + 0.01).any()


def test_a_face_whose_creases_agree_makes_the_normals_confident_that_agree_with_it(settled: Alternation) -> None:
    normals, faced = blended_normals(settled.values, settled.smooth), copy(settled)
    faced.seen_through = np.zeros(settled.labels.shape, bool)
    accepted = np.isfinite(settled.values[..., 0])
    half = accepted & (np.arange(accepted.shape[1]) < 30)
    turned = settled.values @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    faced.faces = replace(
        FlatFaces.none(accepted.shape),
        normals=np.where(half[..., None], settled.values, turned).astype(np.float32),
        residual=np.zeros(accepted.shape),
    )
    before, after = (final_confidence(state, normals) for state in (settled, faced))
    np.testing.assert_array_equal(after[half], np.maximum(before[half], FACE_CONFIDENCE))
    np.testing.assert_array_equal(after[accepted & ~half], before[accepted & ~half])
