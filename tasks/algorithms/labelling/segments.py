"""Connected sheets of accepted normals, and how each stands when the rest of the object is asked about it.

A false sheet can be smooth, and once it is accepted the field follows it, so that the one seems to confirm the other.
Therefore a whole sheet is withheld at a time, and the field from the rim and all other sheets predicts it.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.smooth_normals import field_spread

TIED = float(np.cos(np.radians(5.0)))
"""Neighbouring normals that differ by less belong to one sheet, cosine."""
LEAST_SIZE = 0.004
"""Share of the mask from which a sheet is withheld by itself: many smaller ones cost as many solves."""
UNTOLD = 2.0
"""Surprise of the smaller ones: as large as that of most false sheets."""
FAR = 20.0
"""Degrees beyond which a prediction is no more wrong."""


def connected_sheets(normals: np.ndarray) -> np.ndarray:
    """Numbers (H, W) int from 0 of the connected sheets of normals (H, W, 3; NaN where there is none); -1 there."""
    known = np.isfinite(normals[..., 0])
    height, width = known.shape
    numbers = np.full(known.shape, -1)
    numbers[known] = np.arange(known.sum())
    first, second = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        there = (slice(down, height), slice(max(0, right), width + min(0, right)))
        tied = (normals[here] * normals[there]).sum(axis=-1) > TIED
        first.append(numbers[here][tied])
        second.append(numbers[there][tied])
    pairs = (np.concatenate(first), np.concatenate(second))
    ties = sparse.coo_matrix((np.ones(len(pairs[0])), pairs), shape=(known.sum(), known.sum()))
    sheets = np.full(known.shape, -1)
    sheets[known] = connected_components(ties, directed=False)[1]
    return sheets


def sheet_means(sheets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mean (H, W) of values (H, W) over each pixel's sheet (H, W), NaN outside sheets; a NaN among them counts as 0."""
    inside = sheets >= 0
    numbers = sheets[inside]
    sums = np.bincount(numbers, np.nan_to_num(values[inside]))
    result = np.full(sheets.shape, np.nan)
    result[inside] = (sums / np.maximum(np.bincount(numbers), 1))[numbers]
    return result


def surprise(
    sheets: np.ndarray,
    normals: np.ndarray,
    known: np.ndarray,
    rim: np.ndarray,
    mask: np.ndarray,
    scale: float,
    predict: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """How far each sheet lies from what the rest of the object makes of its place: (H, W), NaN outside sheets.

    sheets, normals (H, W, 3), known, rim, mask (H, W) bool, scale (inradius in pixels); predict(known) -> field
    (H, W, 3) from these normals and the rim. The mean angle, in units of the spread that a field has so far from what
    it knows (`field_spread`); UNTOLD for small sheets.
    """
    result = np.where(sheets >= 0, UNTOLD, np.nan)
    sizes = np.bincount(sheets[sheets >= 0])
    for sheet in np.flatnonzero(sizes >= max(LEAST_SIZE * mask.sum(), 1)):
        withheld = sheets == sheet
        kept = known & ~withheld
        spread = field_spread(kept | rim, scale, ceiling_deg=np.inf)[withheld]
        off = np.minimum(angles(predict(kept)[withheld], normals[withheld]), FAR)
        result[withheld] = off.mean() / np.degrees(spread).mean()
    return result
