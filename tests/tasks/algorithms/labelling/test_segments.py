import numpy as np

from glint.tasks.algorithms.labelling.integrability import window_area
from glint.tasks.algorithms.labelling.segments import (
    MISLED_FIELD_NATS,
    SMALL_SHEET_RESIDUAL,
    held_out_residual,
    segment_sheets,
    sheet_means,
    unexpected_sheets,
)


def tilted(degrees: float) -> np.ndarray:
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def two_sheets() -> np.ndarray:
    """Left and right halves 20 degrees apart, without normals above; a scrap of four pixels stands apart below."""
    normals = np.full((40, 60, 3), np.nan)
    normals[10:30, :30], normals[10:30, 30:] = tilted(0.0), tilted(20.0)
    normals[35:37, 10:12] = tilted(0.0)
    return normals


def test_sheets_end_at_creases_and_gaps() -> None:
    sheets = segment_sheets(two_sheets())
    assert len(np.unique(sheets[10:30, :30])) == len(np.unique(sheets[10:30, 30:])) == 1
    assert len({sheets[20, 5], sheets[20, 50], sheets[35, 10]}) == 3
    assert (sheets[:10] == -1).all()


def test_diagonal_neighbours_belong_together_and_nothing_is_no_sheet() -> None:
    normals = np.full((5, 5, 3), np.nan)
    for i in range(5):
        normals[i, 4 - i] = tilted(0.0)
    assert set(segment_sheets(normals).ravel()) == {-1, 0}
    assert (segment_sheets(np.full((5, 5, 3), np.nan)) == -1).all()


def test_means_are_those_of_each_sheet() -> None:
    sheets = segment_sheets(two_sheets())
    values = np.where(np.arange(60)[None] < 30, 2.0, np.nan) * np.ones((40, 1))
    means = sheet_means(sheets, values)
    assert means[20, 5] == 2.0
    assert means[20, 50] == 0.0
    assert np.isnan(means[0, 0])


def test_a_sheet_that_the_rest_of_the_object_contradicts_has_a_large_residual() -> None:
    normals = two_sheets()
    sheets, known = segment_sheets(normals), np.isfinite(normals[..., 0])
    predicted = []

    def predict(kept: np.ndarray) -> np.ndarray:
        predicted.append(kept)
        return np.broadcast_to(tilted(0.0), normals.shape)

    mask, rim = np.ones((40, 60), dtype=bool), np.zeros((40, 60), dtype=bool)
    residual = held_out_residual(sheets, normals, known, rim, mask, 20.0, predict)
    assert residual[20, 5] < 1e-3
    assert residual[20, 50] > 0.7
    assert residual[35, 10] == SMALL_SHEET_RESIDUAL
    assert np.isnan(residual[0, 0])
    assert len(predicted) == 2
    assert not predicted[0][20, 5]
    assert predicted[0][20, 50]
    assert not predicted[1][20, 50]


def found_sheet(side: int, evidence: float = 1.0, rival: float | None = None) -> np.ndarray:
    """Return which nodes are found of a rejected square sheet, and of a rival accepted in its place, if any."""
    normals = np.full((2, 40, 40, 3), np.nan)
    sheet, other = np.zeros((2, 40, 40), dtype=bool)
    sheet[5 : 5 + side, 5 : 5 + side] = True
    normals[0][sheet], normals[1][sheet] = tilted(30.0), tilted(0.0)
    present = np.isfinite(normals[..., 0])
    labels = np.stack([other, sheet & (rival is not None)])
    ratios = np.where(present, np.array([evidence, -1.0 if rival is None else rival])[:, None, None], np.nan)
    return unexpected_sheets(normals, labels, ratios, ratios > 0.0, 40.0)


def test_a_sheet_that_the_field_contradicts_is_found_by_its_area_and_its_evidence() -> None:
    area = window_area(40.0)
    large = int(np.ceil(np.sqrt(MISLED_FIELD_NATS * area)))
    found = found_sheet(large)
    assert found[0, 5 : 5 + large, 5 : 5 + large].all() and found.sum() == large**2
    assert not found_sheet(large - 1).any()
    assert not found_sheet(large, evidence=0.5).any()
    assert found_sheet(large + 6, evidence=0.9).any()


def test_a_small_round_limb_is_one_sheet() -> None:
    radius = 12.0
    rows, columns = np.indices((40, 40)) - 19.5
    x, y = columns / radius, -rows / radius
    ball = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
    normals = np.where((np.hypot(x, y) < np.sin(np.radians(45.0)))[..., None], ball, np.nan)[None]
    present = np.isfinite(normals[..., 0])
    turn = np.degrees(np.arccos((normals[0, 20, 20] * normals[0, 20, 21]).sum()))
    assert 4.0 < turn < 5.0
    ratios = np.where(present, 1.5, np.nan)
    assert np.array_equal(unexpected_sheets(normals, present & False, ratios, present, 30.0), present)
    # In the image of a large object so rough a sheet is none.
    assert not unexpected_sheets(normals, present & False, ratios, present, 90.0).any()


def test_what_was_accepted_in_its_place_counts_against_it() -> None:
    assert found_sheet(30, rival=-0.5)[0].any()
    assert not found_sheet(30, rival=0.95).any()


def test_nothing_proposed_is_nothing_found() -> None:
    empty = np.zeros((1, 8, 8), dtype=bool)
    assert not unexpected_sheets(np.full((1, 8, 8, 3), np.nan), empty, empty * 1.0, empty, 10.0).any()
