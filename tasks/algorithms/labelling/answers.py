"""Answers as evidence on the sheets that they were given for: marks spread over the nodes of their sheets.

Yeung et al. 2009 (section 4.2) fix the labels of marked nodes alone. In a graph cut that is too little: a pinned node
has at most eight ties, and where hundreds of its neighbours contradict it, cutting those ties is cheaper than labelling
the sheet anew. A user, however, judges the highlight that wanders over a sheet, not one pixel of it.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

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


def mark_influence(
    nodes: np.ndarray, ties: sparse.csr_matrix, pins: np.ndarray, inradius: float, labels: np.ndarray | None = None
) -> np.ndarray:
    """Spread marks over their sheets: (K, H, W), from 1 (exterior) to -1 (false), 0 where no mark reaches.

    Args:
        nodes, ties: of `sheets.sheet_graph`.
        pins: (K, H, W) int8, labels of marked nodes: 1 exterior, -1 false, 0 free.
        inradius: of the mask, in pixels.
        labels: (K, H, W) bool, exterior nodes without the marks. A mark that confirms its node's label says nothing of
            nodes with the other: a sheet that continues it under another label crosses it, or is known better. If
            None, no mark confirms.

    Influence falls with the distance along the sheet; of a true and a false mark, the nearer one counts.
    """
    result = np.zeros(nodes.shape)
    if not pins.any():
        return result
    present, reach_px = nodes >= 0, max(MARK_REACH_INRADII * inradius, 1.0)
    contradicting = pins != 0 if labels is None else contradictions(pins, labels)
    own_ties = ties if labels is None else _ties_within(ties, labels[present])

    def distance(paths: sparse.csr_matrix, marked: np.ndarray) -> np.ndarray:
        """Return the distances (N,) along paths from the marked nodes (K, H, W) bool."""
        sources = np.flatnonzero(marked[present])
        if not len(sources):
            return np.full(np.count_nonzero(present), np.inf)
        return dijkstra(paths, directed=False, indices=sources, min_only=True, limit=MAX_MARK_REACHES * reach_px)

    distances = [
        np.minimum(distance(ties, marked & contradicting), distance(own_ties, marked & ~contradicting))
        for marked in (pins == 1, pins == -1)
    ]
    exterior, false = np.exp(-np.array(distances) / reach_px)
    result[present] = np.where(exterior > false, exterior, np.where(false > exterior, -false, 0.0))
    return result


def contradictions(pins: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the marked nodes (K, H, W) bool whose marks contradict their labels.

    pins: as in `mark_influence`. labels: (K, H, W) bool, exterior nodes.
    """
    return (pins != 0) & (labels != (pins == 1))


def _ties_within(ties: sparse.csr_matrix, labels: np.ndarray) -> sparse.csr_matrix:
    """Return the ties between nodes of one label, labels (N,) bool."""
    pairs = ties.tocoo()
    same = labels[pairs.row] == labels[pairs.col]
    return sparse.csr_matrix((pairs.data[same], (pairs.row[same], pairs.col[same])), shape=ties.shape)


def marked_confidence(confidence: np.ndarray, marked: np.ndarray, influence: np.ndarray) -> np.ndarray:
    """Return the confidence (H, W) of accepted normals, raised where they are marked (H, W) bool or on a marked sheet.

    influence: (H, W), of marks on the sheets of the accepted normals, see `mark_influence`.
    """
    return np.where(marked, 1.0, np.maximum(confidence, MARKED_SHEET_CONFIDENCE * influence))
