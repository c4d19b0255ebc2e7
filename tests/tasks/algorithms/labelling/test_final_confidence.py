import numpy as np
import pytest

from glint.tasks.algorithms.labelling.final_confidence import SMALL_SHEET_RESIDUAL, held_out_residual
from glint.tasks.algorithms.labelling.weights import FieldError
from glint.tasks.algorithms.sheets.segments import segment_sheets
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
    assert residual[:, 100:].min() > 2.9
