"""Segment accepted normals into connected sheets."""

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.geometry.blur import gaussian_blur
from glint.tasks.algorithms.geometry.connected_parts import neighbours

SHEET_STEP_DEG = 5.0
"""Angle up to which neighbouring normals belong to one sheet."""


def segment_sheets(normals: np.ndarray, max_turn_deg: float = SHEET_STEP_DEG) -> np.ndarray:
    """Label the connected sheets of normals.

    normals (H, W, 3), NaN where there is none -> (H, W) int, sheets numbered from 0, -1 without normal. Pixels are
    8-connected. max_turn_deg: angle up to which neighbours belong to one sheet.
    """
    known = np.isfinite(normals[..., 0])
    numbers = np.full(known.shape, -1)
    numbers[known] = np.arange(known.sum())
    first, second = [], []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        pixel, neighbour = neighbours(known.shape, down, right)
        tied = (normals[pixel] * normals[neighbour]).sum(axis=-1) > np.cos(np.radians(max_turn_deg))
        first.append(numbers[pixel][tied])
        second.append(numbers[neighbour][tied])
    pairs = (np.concatenate(first), np.concatenate(second))
    adjacency = sparse.coo_matrix((np.ones(len(pairs[0])), pairs), shape=(known.sum(), known.sum()))
    sheets = np.full(known.shape, -1)
    sheets[known] = connected_components(adjacency, directed=False)[1]
    return sheets


def sheet_means(sheets: np.ndarray, values: np.ndarray, sd: float) -> np.ndarray:
    """Average values over the part of each pixel's sheet that lies in a Gaussian window around the pixel.

    Args:
        sheets: (H, W) int, numbers of the sheets from 0, -1 outside.
        values: (H, W); NaN counts as 0.
        sd: standard deviation of the window, in pixels.

    Returns:
        (H, W), NaN outside sheets. Sheets no longer than the window are averaged as wholes.
    """
    inside, filled = sheets >= 0, np.nan_to_num(values)
    numbers = sheets[inside]
    result = np.full(sheets.shape, np.nan)
    result[inside] = (np.bincount(numbers, filled[inside]) / np.maximum(np.bincount(numbers), 1))[numbers]
    for number, box in enumerate(ndimage.find_objects(sheets + 1)):
        if box is None or max(side.stop - side.start for side in box) <= 2.0 * sd:
            continue
        sheet = sheets[box] == number
        weight, total = gaussian_blur(sheet, sd), gaussian_blur(np.where(sheet, filled[box], 0.0), sd)
        result[box][sheet] = total[sheet] / weight[sheet]
    return result
