"""Segment accepted normals into connected sheets."""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

SHEET_STEP_DEG = 5.0
"""Angle up to which neighbouring normals belong to one sheet."""


def segment_sheets(normals: np.ndarray, max_turn_deg: float = SHEET_STEP_DEG) -> np.ndarray:
    """Label the connected sheets of normals.

    normals (H, W, 3), NaN where there is none -> (H, W) int, sheets numbered from 0, -1 without normal. Pixels are
    8-connected. max_turn_deg: angle up to which neighbours belong to one sheet.
    """
    known = np.isfinite(normals[..., 0])
    height, width = known.shape
    numbers = np.full(known.shape, -1)
    numbers[known] = np.arange(known.sum())
    first, second = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        pixel = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        neighbour = (slice(down, height), slice(max(0, right), width + min(0, right)))
        tied = (normals[pixel] * normals[neighbour]).sum(axis=-1) > np.cos(np.radians(max_turn_deg))
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
