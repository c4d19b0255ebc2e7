"""Normals that no light reached: where nothing flashed, the surface is steeper than all normals that the lights show.

A surface whose normal is a half vector of the recording shows the light. Where the smooth field passes through such
normals, and yet none of a group of neighbouring pixels has a true highlight, the field is wrong: the surface turns away
from the lights, as in a groove, under a chin or beside a limb. How steep it is there is not known, but that it is
steeper than what the lights reach; which way follows from the heights on both sides (integrability).
"""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.vectors import gradients, unit
from glint.tasks.algorithms.integration.expected_rises import poisson_source
from glint.tasks.algorithms.integration.multigrid import solve_poisson
from glint.tasks.algorithms.prior.lit_pixels import LitPixels

DARK_ROUNDS = 4
"""Solutions of the field: the directions of dark pixels follow from the one before."""
MIN_NZ = 0.2
"""Least z of a normal whose slope is integrated: steeper ones say little of heights."""
UNKNOWN_WEIGHT = 0.0005
"""Weight of slopes that neither a highlight nor darkness tells, against 1 for frontal accepted normals."""


def unreached_normals(
    field: np.ndarray, confidence: np.ndarray, pixels: LitPixels, solve: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Estimate the normals (H, W, 3) of dark pixels, NaN elsewhere, and the field (H, W, 3) that follows them.

    None where nothing is dark, or where darkness says nothing of normals (see `LitPixels.is_informative`).

    Args:
        field: (H, W, 3), smooth normal field, finite in the mask.
        confidence: (H, W), of accepted normals, 0 elsewhere.
        pixels: which of them are lit.
        solve: returns the field (H, W, 3) with normals (H, W, 3; NaN elsewhere) among its data.
    """
    if not pixels.is_informative(field, confidence > 0.0):
        return None
    dark = np.zeros_like(pixels.mask)
    for number in range(DARK_ROUNDS):
        dark = dark | pixels.dark(field)
        if not dark.any():
            return None
        direction = _integrable(field, np.where(dark, 1.0, confidence), pixels.mask) if number else field
        unreached = np.where(dark[..., None], pixels.swept.nearest_beyond(direction), np.nan)
        field = solve(unreached)
    return unreached, field


def with_unreached(
    targets: np.ndarray, weights: np.ndarray, unreached: np.ndarray, weight: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the field's targets (H, W, 3) and their weights (H, W) with normals of dark pixels where nothing else is.

    unreached: (H, W, 3), NaN elsewhere; weight: theirs.
    """
    applies = (weights == 0.0) & np.isfinite(unreached[..., 0])
    return np.where(applies[..., None], unreached, targets), np.where(applies, weight, weights)


def _integrable(field: np.ndarray, confidence: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the normals (H, W, 3) of the surface whose slopes fit those of a field (H, W, 3) best.

    Its slopes at a pixel are means over the edges to the pixel's neighbours.

    confidence: (H, W), 0 where the field is neither dark nor accepted. mask: (H, W) bool.
    """
    p, q = gradients(field, floor=MIN_NZ)
    # The error of a slope is that of its normal divided by n_z squared.
    weight = np.where(confidence > 0.0, confidence * field[..., 2] ** 4, UNKNOWN_WEIGHT)
    slopes = np.where(mask, -q, 0.0), np.where(mask, p, 0.0)
    weights, rises = np.zeros((2, *mask.shape)), np.zeros((2, *mask.shape))
    total, count = np.zeros((2, *mask.shape)), np.zeros((2, *mask.shape))
    for axis, slope in enumerate(slopes):
        first, second = _ends(axis)
        inside = mask[first] & mask[second]
        weights[axis][first] = np.where(inside, np.minimum(weight[first], weight[second]), 0.0)
        rises[axis][first] = (slope[first] + slope[second]) / 2.0
    height, _, _ = solve_poisson(weights, poisson_source(weights, rises), np.zeros(mask.shape), tolerance=1e-4)
    for axis in (0, 1):
        first, second = _ends(axis)
        edge = (weights[axis][first] > 0.0) * 1.0
        rise = edge * (height[second] - height[first])
        for end in (first, second):
            total[axis][end] += rise
            count[axis][end] += edge
    down, right = total / np.maximum(count, 1.0)
    return unit(np.stack([-right, down, np.ones(mask.shape)], axis=-1))


def _ends(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the index of the pixels at which edges along an axis begin, and of those at which they end."""
    first, second, whole = slice(None, -1), slice(1, None), slice(None)
    return ((first, whole), (second, whole)) if axis == 0 else ((whole, first), (whole, second))
