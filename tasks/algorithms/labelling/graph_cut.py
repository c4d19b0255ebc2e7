"""Labelling of whole sheets: the graph cut over (pixel, cluster) nodes (paper 4.2, with other weights).

Each kind of light path maps the image smoothly to half vectors, so the nodes of one kind form smooth sheets across
neighbouring pixels and layers. Neighbouring nodes are tied by how well their normals agree, in all layers at once, so
that the cut runs between sheets; the unary term says how well a node fits the expected field.
"""

import maxflow
import numpy as np
from numba import njit

CAP = 2.0 * np.pi * (1.0 - np.cos(np.pi / 4))
"""Solid angle of the normals that can be observed (within 45 degrees of the view vector)."""
CERTAIN = 1e6
"""Evidence of a marked node, in nats: beyond any sum of the others."""


def evidence(normals: np.ndarray, field: np.ndarray, spread: np.ndarray, prior: float = 0.5) -> np.ndarray:
    """Log likelihood ratio of exterior against false for each node.

    normals (K, H, W, 3), field (H, W, 3) and its spread (H, W) in radians -> (K, H, W) float32, NaN without cluster.
    An exterior normal is normally distributed about the field on the sphere, a false one uniform over the observable
    cap; `prior` is the share of exterior nodes.
    """
    chord = np.linalg.norm(normals - field[None], axis=-1)
    angle = 2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0))
    ratio = np.log(CAP / (2.0 * np.pi * spread**2)) - angle**2 / (2.0 * spread**2) + np.log(prior / (1.0 - prior))
    return ratio.astype(np.float32)


@njit(cache=True, nogil=True)
def _nearest(normals: np.ndarray, nodes: np.ndarray, k: int, y: int, x: int, v: int, u: int) -> tuple[int, float]:
    """The layer at pixel (v, u) whose normal is nearest to node (k, y, x), -1 if none, and the squared difference."""
    best, least = -1, np.inf
    for j in range(len(nodes)):
        if nodes[j, v, u] >= 0:
            gap = 0.0
            for a in range(3):
                gap += (normals[k, y, x, a] - normals[j, v, u, a]) ** 2
            if gap < least:
                best, least = j, gap
    return best, least


@njit(cache=True, nogil=True)
def _ties(
    normals: np.ndarray, nodes: np.ndarray, strength: float, contrast: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges between 8-neighbouring pixels: numbers of the two nodes and the weight.

    Only nodes that are each other's nearest are tied: a sheet passes each pixel once, and where two sheets cross they
    must not be glued together.
    """
    layers, height, width = nodes.shape
    first = np.empty(4 * (nodes >= 0).sum(), np.int64)
    second, weight = np.empty_like(first), np.empty(len(first), np.float64)
    size = 0
    for k in range(layers):
        for y in range(height):
            for x in range(width):
                if nodes[k, y, x] < 0:
                    continue
                for dy, dx in ((0, 1), (1, -1), (1, 0), (1, 1)):
                    v, u = y + dy, x + dx
                    if v >= height or u < 0 or u >= width:
                        continue
                    j, gap = _nearest(normals, nodes, k, y, x, v, u)
                    if j < 0 or gap > 7.0 * contrast**2 or _nearest(normals, nodes, j, v, u, y, x)[0] != k:
                        continue
                    first[size], second[size] = nodes[k, y, x], nodes[j, v, u]
                    weight[size] = strength * np.exp(-gap / contrast**2)
                    size += 1
    return first[:size], second[:size], weight[:size]


def label_sheets(normals: np.ndarray, ratios: np.ndarray, strength: float = 10.0, contrast: float = 0.1) -> np.ndarray:
    """Labels (K, H, W) bool of least energy: true = exterior surface.

    normals (K, H, W, 3) unit, NaN where a pixel has no such cluster; ratios (K, H, W) log likelihood ratios. Two
    neighbouring nodes with different labels cost strength exp(-|n_i - n_j|^2 / contrast^2) (nats).
    """
    present = np.isfinite(normals[..., 0])
    labels = np.zeros(present.shape, dtype=bool)
    count = int(present.sum())
    if count == 0:
        return labels
    nodes = np.full(present.shape, -1, dtype=np.int64)
    nodes[present] = np.arange(count)
    first, second, weight = _ties(normals, nodes, strength, contrast)
    graph = maxflow.GraphFloat(count, len(first))
    graph.add_nodes(count)
    if len(first):
        graph.add_edges(first, second, weight, weight)
    ratio = ratios[present].astype(np.float64)
    graph.add_grid_tedges(np.arange(count), np.maximum(ratio, 0.0), np.maximum(-ratio, 0.0))
    graph.maxflow()
    labels[present] = ~graph.get_grid_segments(np.arange(count))
    return labels


def one_per_pixel(labels: np.ndarray, ratios: np.ndarray) -> np.ndarray:
    """Keep of several exterior nodes in a pixel the best (K, H, W) bool: light meets the exterior surface once."""
    best = np.where(labels, ratios, -np.inf).argmax(axis=0)
    return labels & (np.arange(len(labels))[:, None, None] == best[None])
