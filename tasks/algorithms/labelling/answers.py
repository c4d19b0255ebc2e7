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


def mark_influence(nodes: np.ndarray, ties: sparse.csr_matrix, pins: np.ndarray, scale: float) -> np.ndarray:
    """Spread marks over their sheets: (K, H, W), from 1 (exterior) to -1 (false), 0 where no mark reaches.

    Args:
        nodes, ties: of `sheets.sheet_graph`.
        pins: (K, H, W) int8, labels of marked nodes: 1 exterior, -1 false, 0 free.
        scale: inradius of the mask in pixels.

    The nearer of two marks wins, as far along the sheet as it is near.
    """
    result = np.zeros(nodes.shape)
    present = nodes >= 0
    labels, reach_px = pins[present], max(MARK_REACH_INRADII * scale, 1.0)
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
