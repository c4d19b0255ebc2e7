"""Field of settled labels, cut along contours inside the silhouette where what was observed confirms them.

Labels that have settled tell what continues into the gaps between them, and where it ends (`continuation`). The smooth
field is solved once more, cut along these contours, with what continues among its data; dark pixels are bent away from
the lights on their own side of a contour. Not all contours are true. So that field replaces the smooth one only where
it explains better what candidates show and what stays dark: a pixel whose normal faces the lights should have a
candidate near it.
"""

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.continuation.inner_contours import (
    DARK_NATS,
    SHOWN_NATS,
    InnerContours,
    has_candidate,
    inner_contours,
    lifted,
)
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.cut_field import cut_field
from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.prior.unreached import with_unreached

CUT_FIELD_NODES = 40_000
"""Pixels of the mask up to which each is looked at; of larger objects every second, third, .. row and column is."""
CONTINUED_WEIGHT, CONTINUED_INRADII, CONTINUED_VARIANCE = 0.03, 0.2, 0.03
"""Weight of what continues as data of the field, the distance over which it falls to 1/e, and the variance at which it
falls to a half."""
MIN_CHANGE_DEG = 5.0
"""Angle between both fields from which observations may choose."""
CHOICE_INRADII = 0.4
"""Standard deviation of the neighbourhood that chooses, in inradii."""
CHOICE_NATS = (-0.03, 0.07)
"""Mean gain per changed pixel from which the cut field has a part in the result, and from which it is the result: by
most changed pixels nothing was observed."""


def field_with_contours(
    smooth: np.ndarray,
    accepted: np.ndarray,
    candidates: np.ndarray,
    constraints: tuple[np.ndarray, np.ndarray],
    pixels: LitPixels,
    *,
    dark_weight: float,
    tension_length: float,
) -> np.ndarray:
    """Return a smooth field (H, W, 3), cut along contours inside the silhouette where observations confirm them.

    Args:
        smooth: (H, W, 3) unit, finite in the mask.
        accepted: (H, W, 3), accepted normals of the field, NaN elsewhere.
        candidates: (K, H, W, 3), all candidates, NaN without.
        constraints: targets (H, W, 3) of the field and their weights (H, W): accepted normals and occluding contour.
        pixels: which of them are lit.
        dark_weight: of a dark pixel.
        tension_length: see `smooth_normal_field`.
    """
    whole, step = smooth, max(1, int(np.ceil(np.sqrt(pixels.mask.sum() / CUT_FIELD_NODES))))
    pixels, candidates = pixels.subsampled(step), candidates[:, ::step, ::step]
    smooth, accepted, targets, weights = (values[::step, ::step] for values in (smooth, accepted, *constraints))
    known = np.isfinite(accepted[..., 0])
    if not pixels.mask.any() or not pixels.is_informative(smooth, known):
        return whole
    contours = inner_contours(accepted, candidates, pixels)
    if contours is None:
        return whole
    expected = np.where(np.isfinite(contours.variance)[..., None], lifted(contours.plane), smooth)
    unreached = np.where(pixels.dark(expected)[..., None], pixels.swept.nearest_beyond(expected), np.nan)
    targets, weights = with_unreached(targets, weights, unreached, dark_weight)
    continued = np.where(weights == 0.0, _continued_weight(contours, pixels.inradius), 0.0)
    surface = cut_field(pixels.mask, contours.right, contours.down, tension_length)
    cut = surface.solve(np.where(continued[..., None] > 0.0, expected, targets), weights + continued)

    gain = _likelihood(candidates, cut, pixels.swept) - _likelihood(candidates, smooth, pixels.swept)
    is_open = pixels.mask & ~known & (angles(cut, smooth) > MIN_CHANGE_DEG)
    share = _choice(gain, is_open, pixels.inradius)
    change = np.where(pixels.mask[..., None], share[..., None] * (cut - smooth), 0.0)[..., :2]
    return _changed(whole, change, step)


def _continued_weight(contours: InnerContours, inradius: float) -> np.ndarray:
    """Return the weight (H, W) of continued normals: the farther from what continues, and the less sure, the less."""
    weight = CONTINUED_WEIGHT * np.exp(-((contours.distance / (CONTINUED_INRADII * inradius)) ** 2))
    return np.asarray(weight * CONTINUED_VARIANCE / (CONTINUED_VARIANCE + contours.variance))


def _likelihood(candidates: np.ndarray, field: np.ndarray, swept: SweptNormals) -> np.ndarray:
    """Return how likely a field (H, W, 3) makes what candidates (K, H, W, 3) show and what stays dark (H, W), nats."""
    is_shown = has_candidate(candidates, field)
    return np.where(is_shown, SHOWN_NATS, np.where(swept.flashes(field), -DARK_NATS, 0.0))


def _choice(gain: np.ndarray, changed: np.ndarray, inradius: float) -> np.ndarray:
    """Return the share (H, W) of the cut field: by its mean gain (H, W) at changed pixels (H, W) of a neighbourhood."""
    sigma = CHOICE_INRADII * inradius
    total = ndimage.gaussian_filter(np.where(changed, gain, 0.0), sigma)
    mean = total / np.maximum(ndimage.gaussian_filter(changed.astype(float), sigma), 1e-6)
    return np.clip((mean - CHOICE_NATS[0]) / (CHOICE_NATS[1] - CHOICE_NATS[0]), 0.0, 1.0)


def _changed(field: np.ndarray, change: np.ndarray, step: int) -> np.ndarray:
    """Return a field (H, W, 3) whose n_x and n_y are changed, by what is known (h, w, 2) at every `step`-th pixel."""
    rows, columns = np.indices(field.shape[:2]) / step
    parts = [change[..., axis] for axis in (0, 1)]
    fine = [ndimage.map_coordinates(part, [rows, columns], order=1, mode="nearest") for part in parts]
    return lifted(field[..., :2] + np.stack(fine, axis=-1)).astype(np.float32)
