"""Minimum cuts on the pixel grid (Boykov and Jolly 2001): a labelling that follows evidence and strong edges."""

from collections.abc import Mapping, Sequence

import maxflow
import numpy as np

HARD_CAPACITY = 1e4
"""Capacity, in nats, of a pixel whose label is given: above any sum of the other terms at a pixel."""
EDGE_FLOOR = 0.03
"""Capacity of a link across the strongest edge, relative to that without an edge: it shortens contours."""
NEIGHBOURS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.707), (1, -1, 0.707))
"""Rows and columns to the neighbours that follow a pixel, and the weight of the link to them."""

Links = Mapping[tuple[int, int], np.ndarray]
"""Capacities (H, W) of the links from each pixel to the neighbour at (rows, columns) from it."""


def links(images: Sequence[np.ndarray], strength: float, gaussian: bool = False) -> Links:
    """Return the capacities of the links between neighbours, small across edges.

    Args:
        images: (H, W) each; a difference of 1 between neighbours is an edge.
        strength: capacity where there is no edge, nats.
        gaussian: whether capacities fall as exp(-d^2), else as 1 / (1 + d^2), which keeps faint edges in play.
    """
    height, width = images[0].shape
    capacities = {}
    for down, right, weight in NEIGHBOURS:
        first = slice(0, height - down), slice(max(0, -right), width - max(0, right))
        second = slice(down, height), slice(max(0, right), width + min(0, right))
        # Diagonal neighbours are farther apart: the same slope makes a larger difference.
        square = sum((weight * (image[first] - image[second])) ** 2 for image in images)
        likeness = np.exp(-square) if gaussian else 1.0 / (1.0 + square)
        capacity = np.zeros((height, width))
        capacity[first] = strength * weight * (likeness + EDGE_FLOOR)
        capacities[down, right] = capacity
    return capacities


def grid_cut(ratios: np.ndarray, capacities: Links, inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Return the labelling (H, W) bool of minimum energy.

    Args:
        ratios: (H, W) log-likelihood ratios of true against false, nats.
        capacities: of the links, see `links`.
        inside: (H, W) bool, pixels that are true in any case.
        outside: (H, W) bool, pixels that are false in any case; they win over `inside`.
    """
    graph = maxflow.GraphFloat(ratios.size, len(capacities) * ratios.size)
    nodes = graph.add_grid_nodes(ratios.shape)
    for (down, right), capacity in capacities.items():
        structure = np.zeros((3, 3))
        structure[1 + down, 1 + right] = 1.0
        graph.add_grid_edges(nodes, capacity, structure, symmetric=True)
    source = np.where(inside & ~outside, HARD_CAPACITY, np.maximum(ratios, 0.0))
    sink = np.where(outside, HARD_CAPACITY, np.maximum(-ratios, 0.0))
    graph.add_grid_tedges(nodes, np.where(outside, 0.0, source), sink)
    graph.maxflow()
    return ~np.asarray(graph.get_grid_segments(nodes))
