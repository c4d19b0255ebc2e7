"""Sheets cut into patches of one label and a bounded size."""

import numpy as np

from glint.tasks.algorithms.sheets.patches import MIN_PATCH_NODES, Patches, cut_patches
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph


def test_patches_have_one_label_and_a_bounded_size() -> None:
    normals = np.zeros((2, 40, 50, 3), np.float32)
    normals[0], normals[1] = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)
    normals[1, :, 30:] = np.nan
    normals[1, 39, 48:] = (0.6, 0.0, 0.8)  # too small for a patch
    labels = np.zeros((2, 40, 50), np.uint8)
    labels[0, 5:33, 7:45] = 1
    patches = cut_patches(*sheet_graph(normals), labels, inradius=20.0)
    assert (np.diff(patches.number) >= 0).all() and set(patches.number) == set(range(patches.count))
    assert len(patches.number) == 40 * 50 + 40 * 30
    assert np.bincount(patches.number).min() >= MIN_PATCH_NODES
    assert np.isin(patches.mean(patches.of(labels).astype(float)), (0.0, 1.0)).all()
    assert np.isin(patches.mean(patches.layer.astype(float)), (0.0, 1.0)).all()
    for index in (patches.row, patches.column):
        assert max(np.ptp(index[patches.number == number]) for number in range(patches.count)) < 12
    assert patches.exterior(labels).sum() == len({(r // 12, c // 12) for r in range(5, 33) for c in range(7, 45)})


def test_three_nodes_make_a_patch_and_no_nodes_make_none() -> None:
    normals = np.full((1, 1, 20, 3), np.nan, np.float32)
    graph = sheet_graph(normals)
    assert cut_patches(*graph, np.zeros(graph[0].shape), inradius=100.0).count == 0
    normals[0, 0, [0, 1, 10, 11, 12]] = (0.0, 0.0, 1.0)
    patches = cut_patches(*sheet_graph(normals), np.zeros(graph[0].shape), inradius=100.0)
    assert patches.count == 1 and patches.column.tolist() == [10, 11, 12]


def test_values_of_patches_are_those_of_their_nodes() -> None:
    number, layer, row, column = np.array([[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1], [2, 1, 0, 3]])
    patches = Patches(number, layer, row, column, count=2)
    assert patches.sum(np.array([1.0, 2.0, 6.0, 5.0])).tolist() == [9.0, 5.0]
    assert patches.mean(np.array([1.0, 2.0, 6.0, 5.0])).tolist() == [3.0, 5.0]
    labels = np.arange(16).reshape(2, 2, 4)
    assert patches.of(labels).tolist() == [2, 5, 12, 15]
    # Of the first patch two nodes of three are exterior, of the second none.
    assert patches.exterior(np.isin(labels, (2, 5))).tolist() == [True, False]
    assert patches.exterior(np.isin(labels, (2, 15))).tolist() == [False, True]
