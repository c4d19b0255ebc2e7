"""Graph of sheets: candidates of neighbouring pixels are tied where they continue each other.

A *sheet* is a smooth surface that candidates of neighbouring pixels form, as far as it reaches and whatever layers its
nodes are in.
"""

import numpy as np
from numba import njit
from scipy import sparse

MAX_TIED_CONTRASTS = 7.0
"""Squared differences of normals, in squared contrasts, above which two nodes are not tied: exp(-7) is negligible."""
TIE_DEG = 3.0
"""Neighbouring nodes of one sheet differ by less, degrees; beyond it more true and false sheets merge than are made
whole."""
NOISE_TIE_DEG = 1.0
"""Difference of neighbouring nodes that doubles the length of a step, degrees: a sheet is left where it is rough."""


@njit(cache=True, nogil=True)
def _nearest_layer(normals: np.ndarray, nodes: np.ndarray, k: int, y: int, x: int, v: int, u: int) -> tuple[int, float]:
    """Return the layer at pixel (v, u) nearest to node (k, y, x), -1 if none, and the squared difference."""
    nearest, min_gap = -1, np.inf
    for j in range(len(nodes)):
        if nodes[j, v, u] >= 0:
            gap = 0.0
            for a in range(3):
                gap += (normals[k, y, x, a] - normals[j, v, u, a]) ** 2
            if gap < min_gap:
                nearest, min_gap = j, gap
    return nearest, min_gap


@njit(cache=True, nogil=True)
def pairwise_edges(
    normals: np.ndarray, nodes: np.ndarray, strength: float, contrast: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the edges between 8-neighbouring pixels: ids of the two nodes (E,) int64 and weights (E,) float64.

    Only mutually nearest nodes are tied: a sheet passes each pixel once, and two sheets that cross must stay separate.

    normals: (K, H, W, 3) unit, of the nodes; nodes: (K, H, W), their ids, -1 without one; strength: weight of an edge
    between equal normals; contrast: difference of unit normals at which it has fallen to 1/e.
    """
    layers, height, width = nodes.shape
    # Each node has at most one edge to each of the four neighbours that follow it in raster order.
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
                    j, gap = _nearest_layer(normals, nodes, k, y, x, v, u)
                    if j < 0 or gap > MAX_TIED_CONTRASTS * contrast**2:
                        continue
                    # The relation must be mutual, or a node near two sheets would join them.
                    if _nearest_layer(normals, nodes, j, v, u, y, x)[0] != k:
                        continue
                    first[size], second[size] = nodes[k, y, x], nodes[j, v, u]
                    weight[size] = strength * np.exp(-gap / contrast**2)
                    size += 1
    return first[:size], second[:size], weight[:size]


def sheet_graph(normals: np.ndarray) -> tuple[np.ndarray, sparse.csr_matrix]:
    """Return the graph of sheets: numbers of the nodes (K, H, W) int64, -1 without one, and lengths between them.

    normals (K, H, W, 3), unit, NaN without cluster. The matrix (N, N) holds the length in pixels of each tie; a tie is
    the longer the more the two differ.
    """
    present = np.isfinite(normals[..., 0])
    nodes = np.full(present.shape, -1, dtype=np.int64)
    nodes[present] = np.arange(present.sum())
    contrast = np.radians(TIE_DEG)
    first, second, weight = pairwise_edges(normals, nodes, 1.0, contrast)
    degrees = TIE_DEG * np.sqrt(-np.log(weight))
    tied = degrees < TIE_DEG
    length = 1.0 + (degrees[tied] / NOISE_TIE_DEG) ** 2
    count = int(present.sum())
    return nodes, sparse.coo_matrix((length, (first[tied], second[tied])), shape=(count, count)).tocsr()
