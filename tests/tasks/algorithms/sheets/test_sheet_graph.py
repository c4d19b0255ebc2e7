"""The graph that ties the nodes of a sheet through all layers."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.sheets.sheet_graph import pairwise_edges, sheet_graph


def tilted(degrees: float) -> np.ndarray:
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))], np.float32)


def test_sheets_stay_whole_and_apart_across_layers_and_lacking_pixels_have_no_node() -> None:
    normals = np.empty((2, 12, 20, 3), np.float32)
    normals[0], normals[1] = tilted(0.0), tilted(30.0)
    normals[:, :, 10:] = normals[::-1, :, 10:]
    normals[:, 5, 5] = np.nan
    nodes, ties = sheet_graph(normals)
    assert (nodes[:, 5, 5] == -1).all() and (np.sort(nodes[nodes >= 0]) == np.arange(2 * 12 * 20 - 2)).all()
    count, part = connected_components(ties, directed=False)
    assert count == 2
    assert part[nodes[0, 0, 0]] == part[nodes[1, 0, 19]] != part[nodes[1, 0, 0]] == part[nodes[0, 0, 19]]


def test_a_tie_is_the_longer_the_more_its_nodes_differ_and_ends_at_three_degrees() -> None:
    angles = np.cumsum([0.0, 0.0, 1.0, 2.0, 4.0])
    nodes, ties = sheet_graph(np.stack([tilted(angle) for angle in angles])[None, None])
    lengths = [ties[nodes[0, 0, i], nodes[0, 0, i + 1]] for i in range(4)]
    assert lengths == pytest.approx([1.0, 2.0, 5.0, 0.0], abs=0.01)


def test_each_pixel_is_tied_to_its_eight_neighbours_and_none_across_the_border_of_the_image() -> None:
    height, width = 4, 5
    nodes = np.arange(height * width).reshape(1, height, width)
    first, second, _ = pairwise_edges(np.full((1, height, width, 3), tilted(10.0)), nodes, 1.0, 0.1)
    rows, columns = np.divmod(np.stack([first, second]), width)
    assert np.maximum(np.abs(np.diff(rows, axis=0)), np.abs(np.diff(columns, axis=0))).max() == 1
    pairs = {frozenset(pair) for pair in zip(first.tolist(), second.tolist(), strict=True)}
    assert len(pairs) == len(first) == height * (width - 1) + (height - 1) * width + 2 * (height - 1) * (width - 1)


def test_the_weight_of_an_edge_falls_with_the_squared_difference_and_ends_where_it_is_negligible() -> None:
    near, far = 0.24, 0.28
    normals = np.array([[[(0.0, 0.0, 1.0)]], [[(near, 0.0, 1.0)]]]).reshape(1, 1, 2, 3)
    nodes = np.arange(2).reshape(1, 1, 2)
    assert pairwise_edges(normals, nodes, 10.0, 0.1)[2] == pytest.approx(10.0 * np.exp(-((near / 0.1) ** 2)))
    normals[0, 0, 1, 0] = far
    assert not len(pairwise_edges(normals, nodes, 10.0, 0.1)[2])


def test_a_node_between_two_sheets_is_tied_to_the_one_to_which_it_is_nearest_alone() -> None:
    left = np.array([[tilted(0.0)], [tilted(2.0)]])
    right = np.array([[tilted(0.5)], [(np.nan,) * 3]])
    nodes, ties = sheet_graph(np.concatenate([left, right], axis=1).reshape(2, 1, 2, 3))
    pairs = ties.tocoo()
    assert (pairs.row.tolist(), pairs.col.tolist()) == ([nodes[0, 0, 0]], [nodes[0, 0, 1]])
