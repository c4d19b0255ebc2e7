import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.labelling.graph_cut import HARD_CONSTRAINT, GraphCut, keep_best_per_pixel, unary_log_ratio

SIZE = 30


def crossing_sheets() -> tuple[np.ndarray, np.ndarray]:
    """Two smooth sheets (2, H, W, 3) that cross on the middle column, and where (H, W) their layers are swapped."""
    rows, columns = (np.indices((SIZE, SIZE)) - SIZE / 2) / SIZE
    true = unit(np.stack([columns, -rows, np.ones_like(rows)], axis=-1))
    false = unit(np.stack([-columns, -rows + 0.2, np.ones_like(rows)], axis=-1))
    swap = np.random.default_rng(0).random((SIZE, SIZE)) < 0.5
    return np.where(swap[None, ..., None], np.stack([false, true]), np.stack([true, false])).astype(np.float32), swap


def test_the_log_ratio_prefers_the_field_by_its_spread() -> None:
    field = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (1, 3, 3))
    tilted = np.radians([0.0, 10.0, 40.0])
    normals = np.stack([np.sin(tilted), np.zeros(3), np.cos(tilted)], axis=-1)[None, None]
    certain = unary_log_ratio(normals, field, np.full((1, 3), np.radians(5.0)))[0, 0]
    uncertain = unary_log_ratio(normals, field, np.full((1, 3), np.radians(30.0)))[0, 0]
    assert certain[0] > certain[1] > 0 > certain[2]
    assert certain[0] > uncertain[0] and certain[2] < uncertain[2]


def test_the_log_ratio_compares_a_normal_distribution_with_a_uniform_one_over_the_observable_cap() -> None:
    field, angle, spread, prior = np.array([[[0.0, 0.0, 1.0]]]), 0.3, 0.2, 0.2
    normals = np.array([np.sin(angle), 0.0, np.cos(angle)])[None, None, None]
    density = np.exp(-(angle**2) / (2.0 * spread**2)) / (2.0 * np.pi * spread**2)
    cap = 2.0 * np.pi * (1.0 - np.cos(np.pi / 4.0))
    expected = np.log(density * cap) + np.log(prior / (1.0 - prior))
    assert unary_log_ratio(normals, field, np.full((1, 1), spread), prior) == pytest.approx(expected, rel=1e-5)


def test_the_log_ratio_is_nan_without_a_cluster() -> None:
    field = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (1, 1, 3))
    assert np.isnan(unary_log_ratio(np.full((1, 1, 1, 3), np.nan), field, np.full((1, 1), 0.1))).all()


def test_a_few_decided_nodes_label_the_whole_sheet() -> None:
    normals, swap = crossing_sheets()
    ratios = np.full((2, SIZE, SIZE), -0.01, np.float32)
    right_layer = np.where(swap, 1, 0)
    for column in (3, 4, 25, 26):
        for row in range(SIZE):
            ratios[right_layer[row, column], row, column] = 5.0
            ratios[1 - right_layer[row, column], row, column] = -5.0
    labels = GraphCut(normals).cut(ratios)
    true = np.take_along_axis(labels, right_layer[None], axis=0)[0]
    false = np.take_along_axis(labels, 1 - right_layer[None], axis=0)[0]
    assert true.mean() > 0.97 and false.mean() < 0.03


def test_both_nodes_of_a_pixel_may_be_rejected() -> None:
    normals, _ = crossing_sheets()
    assert not GraphCut(normals).cut(np.full((2, SIZE, SIZE), -1.0, np.float32)).any()


def test_a_mark_decides_against_all_neighbours() -> None:
    normals, swap = crossing_sheets()
    ratios = np.full((2, SIZE, SIZE), -0.05, np.float32)
    ratios[np.where(swap, 1, 0)[15, 5], 15, 5] = HARD_CONSTRAINT
    labels = GraphCut(normals).cut(ratios)
    assert labels[np.where(swap, 1, 0)[15, 5], 15, 5]


def test_a_second_cut_is_that_of_a_new_graph() -> None:
    normals, _ = crossing_sheets()
    first, second = np.random.default_rng(1).normal(size=(2, 2, SIZE, SIZE)).astype(np.float32) * 20.0
    graph = GraphCut(normals)
    assert graph.cut(first).any()
    assert np.array_equal(graph.cut(second), GraphCut(normals).cut(second))


def test_no_cluster_at_all() -> None:
    empty = np.full((3, 4, 5, 3), np.nan, np.float32)
    assert not GraphCut(empty).cut(np.full((3, 4, 5), np.nan, np.float32)).any()


def test_one_exterior_node_per_pixel_is_the_best() -> None:
    labels = np.array([[[True, False, True]], [[True, False, False]]])
    ratios = np.array([[[1.0, 1.0, -2.0]], [[2.0, 5.0, 9.0]]])
    assert keep_best_per_pixel(labels, ratios).tolist() == [[[False, False, True]], [[True, False, False]]]
