"""What a mark says about the sheet on which it lies."""

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.labelling.answers import (
    MARK_REACH_INRADII,
    MARKED_SHEET_CONFIDENCE,
    contradictions,
    mark_influence,
    marked_confidence,
)
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph
from tests.tasks.algorithms.labelling.scenes import SHEETS_ALONE, Scene, pebble


def two_sheets(size: int = 40) -> np.ndarray:
    """Two smooth sheets (2, H, W, 3), 30 degrees apart, which change layers in the right half."""
    rows, columns = np.indices((size, size)) / size - 0.5
    first = unit(np.stack([0.3 * columns, 0.3 * rows, np.ones_like(rows)], axis=-1))
    second = unit(np.stack([0.3 * columns + 0.6, 0.3 * rows, np.ones_like(rows)], axis=-1))
    nodes = np.stack([first, second])
    nodes[:, :, size // 2 :] = nodes[::-1, :, size // 2 :]
    return nodes.astype(np.float32)


def test_a_mark_speaks_for_its_own_sheet_across_layers_and_fades() -> None:
    nodes = two_sheets()
    pins = np.zeros(nodes.shape[:3], np.int8)
    pins[0, 20, 15] = 1
    influence = mark_influence(*sheet_graph(nodes), pins, inradius=60.0)
    assert influence[0, 20, 15] == 1.0
    assert influence[1, 20, 25] > 0.2 and influence[0, 20, 25] == 0.0
    assert influence[1, 20, 15] == 0.0
    row = np.concatenate([influence[0, 20, 15:20], influence[1, 20, 20:30]])
    assert (np.diff(row) < 0).all()


def test_the_nearer_of_two_marks_wins() -> None:
    nodes = two_sheets()
    pins = np.zeros(nodes.shape[:3], np.int8)
    pins[0, 20, 4], pins[0, 20, 16] = 1, -1
    influence = mark_influence(*sheet_graph(nodes), pins, inradius=40.0)[0, 20]
    assert (influence[:10] > 0).all() and (influence[11:20] < 0).all()


def test_a_mark_fades_over_its_reach_and_says_nothing_beyond_three_of_them() -> None:
    nodes = np.full((1, 1, 60, 3), (0.0, 0.0, 1.0))
    pins = np.zeros(nodes.shape[:3], np.int8)
    pins[0, 0, 0] = -1
    # Ten pixels are a reach.
    influence = mark_influence(*sheet_graph(nodes), pins, inradius=10.0 / MARK_REACH_INRADII)[0, 0]
    np.testing.assert_allclose(influence[[0, 10, 30]], [-1.0, -np.exp(-1.0), -np.exp(-3.0)])
    assert not influence[31:].any()


def test_a_true_mark_raises_the_confidence_on_its_sheet_and_a_false_one_lowers_none() -> None:
    confidence, marked = np.array([0.2, 0.99, 0.2, np.nan, 0.2]), np.array([False, False, False, False, True])
    raised = marked_confidence(confidence, marked, np.array([0.5, 0.5, -1.0, 0.0, 0.0]))
    np.testing.assert_array_equal(raised, [0.5 * MARKED_SHEET_CONFIDENCE, 0.99, 0.2, np.nan, 1.0])


def test_without_marks_nothing_is_said() -> None:
    nodes = two_sheets()
    pins = np.zeros(nodes.shape[:3], np.int8)
    assert not mark_influence(*sheet_graph(nodes), pins, inradius=20.0).any()


@pytest.mark.parametrize("pin", [1, -1])
def test_a_mark_that_confirms_a_label_is_silent_about_the_other(pin: int) -> None:
    """Where sheets merge, a mark on the rightly labelled one must not tip the other."""
    nodes = two_sheets()
    graph, pins = sheet_graph(nodes), np.zeros(nodes.shape[:3], np.int8)
    pins[0, 20, 4] = pin
    labels = np.zeros(pins.shape, bool)
    labels[0, :, :10] = True
    confirming, news = (
        mark_influence(*graph, pins, 40.0, known) for known in (labels == (pin == 1), labels != (pin == 1))
    )
    assert (pin * news[0, 20, :16] > 0).all()
    assert (confirming[0, 20, :10] == news[0, 20, :10]).all() and not confirming[0, 20, 10:].any()


def test_a_mark_contradicts_the_other_label() -> None:
    pins = np.array([1, 1, -1, -1, 0, 0], np.int8).reshape(3, 1, 2)
    labels = np.array([True, False, True, False, True, False]).reshape(3, 1, 2)
    assert contradictions(pins, labels).ravel().tolist() == [False, True, True, False, False, False]


@pytest.mark.parametrize("kind", [1, 0])
def test_one_mark_labels_the_middle_of_its_sheet(kind: int) -> None:
    """A mark against all evidence: the false sheet called true, or the true one false, with its surroundings."""
    scene: Scene = pebble(60)
    clusters, mask, truth = scene
    centre = np.array([[30, 30]], np.int32)
    false = clusters.normals[:, 30, 30][np.argsort(clusters.normals[:, 30, 30] @ truth[30, 30])[0]]
    vector = false if kind == 1 else truth[30, 30]
    marks = Marks(centre, vector[None].astype(np.float32), np.array([kind], np.int8))
    around = np.s_[27:34, 27:34]
    right = (clusters.normals * truth[None]).sum(axis=-1) > np.cos(np.radians(6.0))
    before = reconstruct_normals(clusters, mask, SHEETS_ALONE).labels > 0
    after = reconstruct_normals(clusters, mask, SHEETS_ALONE, marks=marks).labels > 0
    assert (before & right).any(axis=0)[around].mean() > 0.6
    assert (after & right).any(axis=0)[around].mean() < (0.45 if kind == 1 else 0.2)
