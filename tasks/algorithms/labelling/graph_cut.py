"""Binary labelling of candidate normals by a graph cut over (pixel, cluster) nodes: section 4.2, with other weights.

As in the paper, an energy of unary and pairwise terms is minimised by max-flow (Boykov and Kolmogorov 2004). Unlike the
paper's, the pairwise term is contrast-sensitive (Boykov and Jolly 2001) and ties mutually nearest nodes across all
layers: nodes of one sheet (see `reconstruction`) are tied strongly, so the cut runs between sheets and labels them
whole. The unary term is the log-likelihood ratio of a node under the smooth field's error model.
"""

from typing import Any

import maxflow
import numpy as np
from numba import njit

from glint.tasks.algorithms.sheets.sheet_graph import pairwise_edges

OBSERVABLE_SOLID_ANGLE = 2.0 * np.pi * (1.0 - np.cos(np.pi / 4))
"""Steradians: normals within 45 degrees of the view vector, the only ones that can be observed."""
HARD_CONSTRAINT = 1e6
"""Unary log-likelihood ratio of a marked node, nats: larger than any sum of the remaining terms at a node."""


def unary_log_ratio(normals: np.ndarray, field: np.ndarray, spread: np.ndarray, prior: float = 0.5) -> np.ndarray:
    """Compute the unary log-likelihood ratio of exterior against false for each node.

    An exterior normal is normally distributed about the field on the sphere, a false one uniform over the observable
    cap.

    Args:
        normals: (K, H, W, 3) unit, NaN without cluster.
        field: (H, W, 3) unit, the smooth normal field.
        spread: (H, W) standard deviation of the field in radians.
        prior: share of the nodes that are exterior.

    Returns:
        (K, H, W) float32, nats, NaN without cluster.
    """
    constant = np.log(OBSERVABLE_SOLID_ANGLE / (2.0 * np.pi * spread**2)) + np.log(prior / (1.0 - prior))
    return np.asarray(_gaussian_log_ratio(normals, field, spread, constant))


@njit(cache=True, nogil=True)
def _gaussian_log_ratio(normals: np.ndarray, field: np.ndarray, spread: np.ndarray, constant: np.ndarray) -> np.ndarray:
    """Return constant (H, W) less half the squared angle between normals (K, H, W, 3) and field in spreads (H, W)."""
    layers, height, width, _ = normals.shape
    result = np.full((layers, height, width), np.nan, np.float32)
    for k in range(layers):
        for y in range(height):
            for x in range(width):
                if np.isnan(normals[k, y, x, 0]):
                    continue
                square = 0.0
                for a in range(3):
                    square += (normals[k, y, x, a] - field[y, x, a]) ** 2
                angle = 2.0 * np.arcsin(min(np.sqrt(square) / 2.0, 1.0))
                result[k, y, x] = constant[y, x] - angle**2 / (2.0 * spread[y, x] ** 2)
    return result


class GraphCut:
    """The graph of one set of candidate normals, to be cut for changing ratios.

    Each cut begins with the flow of the last one, which the same edges allow (Kohli and Torr 2007): capacities change
    by the differences of the ratios, and the minimum is the same as without it.
    """

    def __init__(self, normals: np.ndarray, strength: float = 10.0, contrast: float = 0.1) -> None:
        """Make the graph.

        Args:
            normals: (K, H, W, 3) unit, NaN without cluster.
            strength, contrast: neighbouring nodes of different labels cost strength exp(-|n_i - n_j|^2 / contrast^2),
                nats.
        """
        self._present = np.isfinite(normals[..., 0])
        count = int(self._present.sum())
        self._ratios = np.zeros(count)
        self._graph: Any = None
        if count == 0:
            return
        nodes = np.full(self._present.shape, -1, dtype=np.int64)
        nodes[self._present] = np.arange(count)
        first, second, weight = pairwise_edges(normals, nodes, strength, contrast)
        self._graph = maxflow.GraphFloat(count, len(first))
        self._graph.add_nodes(count)
        if len(first):
            self._graph.add_edges(first, second, weight, weight)

    def cut(self, ratios: np.ndarray) -> np.ndarray:
        """Return the labelling of minimum energy, (K, H, W) bool, true = exterior surface.

        ratios: (K, H, W) unary log-likelihood ratios, nats, read where there is a cluster.
        """
        labels = np.zeros(self._present.shape, dtype=bool)
        if self._graph is None:
            return labels
        numbers, wanted = np.arange(len(self._ratios)), ratios[self._present].astype(np.float64)
        change, self._ratios = wanted - self._ratios, wanted
        self._graph.add_grid_tedges(numbers, np.maximum(change, 0.0), np.maximum(-change, 0.0))
        self._graph.maxflow()
        labels[self._present] = ~self._graph.get_grid_segments(numbers)
        return labels


def keep_best_per_pixel(labels: np.ndarray, ratios: np.ndarray) -> np.ndarray:
    """Keep, of several exterior nodes of a pixel, the one with the highest ratio: light meets the surface once.

    labels (K, H, W) bool, ratios (K, H, W) -> (K, H, W) bool.
    """
    best = np.where(labels, ratios, -np.inf).argmax(axis=0)
    return labels & (np.arange(len(labels))[:, None, None] == best[None])
