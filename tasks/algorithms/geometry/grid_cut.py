"""Minimum cuts on the pixel grid (Boykov and Jolly 2001): a labelling that follows evidence and strong edges."""

from collections.abc import Mapping, Sequence

import maxflow
import numpy as np

from glint.tasks.algorithms.geometry.connected_parts import neighbours

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
    capacities = {}
    for down, right, weight in NEIGHBOURS:
        first, second = neighbours(images[0].shape, down, right)
        # Diagonal neighbours are farther apart: the same slope makes a larger difference.
        square = sum((weight * (image[first] - image[second])) ** 2 for image in images)
        likeness = np.exp(-square) if gaussian else 1.0 / (1.0 + square)
        capacity = np.zeros(images[0].shape)
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
    result, free = inside & ~outside, ~(inside | outside)
    count = int(free.sum())
    if count == 0:
        return result
    nodes = np.full(ratios.shape, -1)
    nodes[free] = np.arange(count)
    graph = maxflow.GraphFloat(count, len(capacities) * count)
    graph.add_nodes(count)
    # A link to a pixel whose label is given speaks for that label.
    source, sink = np.maximum(ratios, 0.0), np.maximum(-ratios, 0.0)
    for (down, right), capacity in capacities.items():
        first, second = neighbours(ratios.shape, down, right)
        capacity = capacity[first]
        is_link = free[first] & free[second]
        weights = capacity[is_link]
        graph.add_edges(nodes[first][is_link], nodes[second][is_link], weights, weights)
        for own, other in ((first, second), (second, first)):
            source[own] += np.where(result[other], capacity, 0.0)
            sink[own] += np.where(outside[other], capacity, 0.0)
    numbers = np.arange(count)
    graph.add_grid_tedges(numbers, source[free], sink[free])
    graph.maxflow()
    result[free] = ~np.asarray(graph.get_grid_segments(numbers))
    return result
