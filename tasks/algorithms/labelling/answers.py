"""Answers as evidence on the sheets that they were given for: marks spread over the nodes of their sheets.

Yeung et al. 2009 (section 4.2) fix the labels of marked nodes alone. In a graph cut that is too little: a pinned node
has at most eight ties, and where hundreds of its neighbours contradict it, cutting those ties is cheaper than labelling
the sheet anew. A user, however, judges the highlight that wanders over a sheet, not one pixel of it.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from glint.tasks.algorithms.labelling.graph_cut import pairwise_edges

TIE_DEG = 3.0
"""Neighbouring nodes of one sheet differ by less, degrees; beyond it more true and false sheets merge than are made
whole."""
NOISE_TIE_DEG = 1.0
"""Difference of neighbouring nodes that doubles the length of a step, degrees: a sheet is left where it is rough."""
MARK_REACH_INRADII = 0.3
"""Distance along the sheet, in inradii, at which a mark's influence has fallen to 1/e: beyond it true and false sheets
that cross merge."""
MAX_MARK_REACHES = 3.0
"""Multiple of the reach beyond which a mark says nothing."""
MARKED_SHEET_NATS = 30.0
"""Unary log-likelihood ratio that a mark gives its sheet's nodes beside it, nats: more than field and shape oppose, but
nodes far along the sheet that contradict it do not follow."""
MARKED_SHEET_CONFIDENCE = 0.97
"""Confidence of accepted normals beside a true mark on the same sheet."""


def sheet_graph(normals: np.ndarray, tie_deg: float = TIE_DEG) -> tuple[np.ndarray, sparse.csr_matrix]:
    """Return the graph of sheets: numbers of the nodes (K, H, W) int64, -1 without one, and lengths between them.

    normals (K, H, W, 3), unit, NaN without cluster. tie_deg: neighbouring nodes that differ by less are tied. The
    matrix (N, N) holds the length in pixels of each tie; a tie is the longer the more the two differ.
    """
    present = np.isfinite(normals[..., 0])
    nodes = np.full(present.shape, -1, dtype=np.int64)
    nodes[present] = np.arange(present.sum())
    contrast = np.radians(tie_deg)
    first, second, weight = pairwise_edges(normals, nodes, 1.0, contrast)
    degrees = tie_deg * np.sqrt(-np.log(np.maximum(weight, 1e-30)))
    tied = degrees < tie_deg
    length = 1.0 + (degrees[tied] / NOISE_TIE_DEG) ** 2
    count = int(present.sum())
    return nodes, sparse.coo_matrix((length, (first[tied], second[tied])), shape=(count, count)).tocsr()


def mark_influence(
    nodes: np.ndarray, ties: sparse.csr_matrix, pins: np.ndarray, scale: float, reach: float = MARK_REACH_INRADII
) -> np.ndarray:
    """Spread marks over their sheets: (K, H, W), from 1 (exterior) to -1 (false), 0 where no mark reaches.

    Args:
        nodes, ties: of `sheet_graph`.
        pins: (K, H, W) int8, labels of marked nodes: 1 exterior, -1 false, 0 free.
        scale: inradius of the mask in pixels.
        reach: in inradii.

    The nearer of two marks wins, as far along the sheet as it is near.
    """
    result = np.zeros(nodes.shape)
    present = nodes >= 0
    labels, reach_px = pins[present], max(reach * scale, 1.0)
    distances = []
    for label in (1, -1):
        sources = np.flatnonzero(labels == label)
        if not len(sources):
            distances.append(np.full(len(labels), np.inf))
            continue
        distances.append(
            dijkstra(ties, directed=False, indices=sources, min_only=True, limit=MAX_MARK_REACHES * reach_px)
        )
    exterior, false = (np.exp(-distance / reach_px) for distance in distances)
    result[present] = np.where(exterior > false, exterior, np.where(false > exterior, -false, 0.0))
    return result


def marked_confidence(confidence: np.ndarray, marked: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """Return the confidence (H, W) of accepted normals, raised where they are marked (H, W) bool or on a marked sheet.

    influence: (H, W), of marks on the sheets of the accepted normals, see `mark_influence`.
    """
    return np.where(marked, 1.0, np.maximum(confidence, MARKED_SHEET_CONFIDENCE * influence))
