"""Segment normals into connected sheets, and judge each as a whole.

Accepted sheets are scored by their residual against the field of all the rest. A false sheet can be smooth, and once it
is accepted the field follows it, so that each seems to confirm the other. Therefore a whole sheet is held out at a time
and predicted from the occluding contour and all remaining sheets (leave-one-out cross-validation with sheets as folds).

A true sheet can be rejected, because the field misleads: the silhouette says nothing of a limb that hangs before the
body. If the field is wrong there, it is wrong for the sheet as a whole, which is one event and no evidence of each
node. What the nodes' own shape says for them grows with the area of the sheet, so a large one outweighs that event.

For sheets see `reconstruction`; the paper has neither test.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.answers import TIE_DEG, sheet_graph
from glint.tasks.algorithms.labelling.graph_cut import keep_best_per_pixel
from glint.tasks.algorithms.labelling.integrability import window_area
from glint.tasks.algorithms.prior.smooth_normals import field_spread

SAME_SHEET_COSINE = float(np.cos(np.radians(5.0)))
"""Neighbouring normals belong to one sheet if they differ by less than 5 degrees."""
MIN_HELD_OUT_SHARE = 0.004
"""Sheets of at least this share of the mask are held out; each costs a solve, and smaller ones are many."""
SMALL_SHEET_RESIDUAL = 2.0
"""Residual given to smaller sheets: as large as that of most false sheets."""
MAX_RESIDUAL_DEG = 20.0
"""Angles to the prediction are clipped here: beyond it a sheet is no more wrong."""
MISLED_FIELD_NATS = 4.0
"""Evidence that the nodes of a sheet must have beyond their rivals' for the field to be wrong there: one such sheet in
fifty is taken to be true beforehand."""
LEAST_RADIUS_INRADII = 0.27
"""Radius of curvature down to which an unexpected sheet stays whole, although its normals turn fast from pixel to pixel
in a small image."""


def segment_sheets(normals: np.ndarray) -> np.ndarray:
    """Label the connected sheets of normals.

    normals (H, W, 3), NaN where there is none -> (H, W) int, sheets numbered from 0, -1 without normal. Pixels are
    8-connected.
    """
    known = np.isfinite(normals[..., 0])
    height, width = known.shape
    numbers = np.full(known.shape, -1)
    numbers[known] = np.arange(known.sum())
    first, second = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        pixel = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        neighbour = (slice(down, height), slice(max(0, right), width + min(0, right)))
        tied = (normals[pixel] * normals[neighbour]).sum(axis=-1) > SAME_SHEET_COSINE
        first.append(numbers[pixel][tied])
        second.append(numbers[neighbour][tied])
    pairs = (np.concatenate(first), np.concatenate(second))
    adjacency = sparse.coo_matrix((np.ones(len(pairs[0])), pairs), shape=(known.sum(), known.sum()))
    sheets = np.full(known.shape, -1)
    sheets[known] = connected_components(adjacency, directed=False)[1]
    return sheets


def sheet_means(sheets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Average values (H, W) over each pixel's sheet (H, W): (H, W), NaN outside sheets; a NaN value counts as 0."""
    inside = sheets >= 0
    numbers = sheets[inside]
    sums = np.bincount(numbers, np.nan_to_num(values[inside]))
    result = np.full(sheets.shape, np.nan)
    result[inside] = (sums / np.maximum(np.bincount(numbers), 1))[numbers]
    return result


def held_out_residual(
    sheets: np.ndarray,
    normals: np.ndarray,
    known: np.ndarray,
    rim: np.ndarray,
    mask: np.ndarray,
    scale: float,
    predict: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Compute each sheet's held-out (leave-one-out) residual: its mean angle to the field of all remaining data.

    Args:
        sheets: (H, W) int, numbers of the sheets, -1 outside.
        normals: (H, W, 3) accepted normals.
        known, rim, mask: (H, W) bool; accepted normals of the field, occluding contour, object.
        scale: inradius of the mask in pixels.
        predict: maps known pixels (H, W) bool to the field (H, W, 3) from these normals, the contour and dark pixels.

    Returns:
        (H, W), in units of the field's expected error at the sheet's distance from the remaining data (`field_spread`);
        SMALL_SHEET_RESIDUAL for small sheets, NaN outside sheets.
    """
    result = np.where(sheets >= 0, SMALL_SHEET_RESIDUAL, np.nan)
    sizes = np.bincount(sheets[sheets >= 0])
    for sheet in np.flatnonzero(sizes >= max(MIN_HELD_OUT_SHARE * mask.sum(), 1)):
        withheld = sheets == sheet
        kept = known & ~withheld
        # Without a ceiling: a sheet far from everything else must not be blamed for a poor prediction.
        spread = field_spread(kept | rim, scale, ceiling_deg=np.inf)[withheld]
        residual = np.minimum(angles(predict(kept)[withheld], normals[withheld]), MAX_RESIDUAL_DEG)
        result[withheld] = residual.mean() / np.degrees(spread).mean()
    return result


def unexpected_sheets(
    normals: np.ndarray, labels: np.ndarray, ratios: np.ndarray, proposed: np.ndarray, scale: float
) -> np.ndarray:
    """Find rejected sheets that would be exterior, rather than what was accepted in their place, if the field is wrong.

    Args:
        normals: (K, H, W, 3) unit, camera frame, NaN without cluster.
        labels: (K, H, W) bool, present exterior nodes.
        ratios: (K, H, W) log-likelihood ratios in nats under a field that hardly matters.
        proposed: (K, H, W) bool, the exterior nodes of the graph's cut by these.
        scale: inradius of the mask in pixels.

    Returns:
        (K, H, W) bool, the nodes of these sheets, at most one at a pixel.
    """
    nodes = keep_best_per_pixel(proposed, ratios) & ~labels
    if not nodes.any():
        return nodes
    # The field follows what was accepted, so that it agrees with a rival is no evidence for it.
    rival = np.where(labels, ratios, 0.0).sum(axis=0)
    turn_deg = float(np.degrees(1.0 / (LEAST_RADIUS_INRADII * scale)))
    _, ties = sheet_graph(np.where(nodes[..., None], normals, np.nan), max(TIE_DEG, turn_deg))
    sheets = connected_components(ties, directed=False)[1]
    # Nodes under one window share their noise, so they are one observation.
    gain = np.bincount(sheets, (ratios - rival)[nodes]) / window_area(scale)
    nodes[nodes] = gain[sheets] >= MISLED_FIELD_NATS
    return nodes
