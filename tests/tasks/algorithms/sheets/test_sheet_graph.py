"""The graph that ties the nodes of a sheet through all layers."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph


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
