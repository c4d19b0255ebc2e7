"""The probability that a pixel's normal is within 5 degrees of the truth.

Observed normals are wrong when their sheet is: that shows in how smoothly the normals vary, in whether they integrate
(a normal field's gradients have no curl; the half vectors of an internal path have) and turn outwards, and in whether
the rest of the object expects such a sheet there. While labels still change, what the neighbourhood shows must do.
Elsewhere the field is as good as it proves where the object lets it be checked: it is asked to predict blocks of
accepted normals that are withheld from it.
"""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import angles, gradients, unit

TOLERANCE = np.radians(5.0)
OBSERVED_WEIGHTS = (2.5, 4.5, -1.2, -5.5)
"""Logit of an observed normal being right by its neighbourhood: constant, cover, roughness, curl of `sheet_quality`."""
SHEET_WEIGHTS = (4.7, -0.9, -2.0, 0.8, -1.7)
"""The same by its whole sheet: constant, roughness, curl, mean evidence of shape and surprise of the sheet.

Fitted to simulated captures of 600 to 1,200 frames of fish, bird, jug and glasses."""
RIM_TRUST = 0.7
"""Share of rims that are occluding contours, not creases or cuts: no field extrapolated to one is surer."""
RAYLEIGH_NINTH_DECILE = 2.146


def within_tolerance(spread: np.ndarray) -> np.ndarray:
    """Probability that an error of standard deviation `spread` (radians, per axis) is below 5 degrees."""
    return 1.0 - np.exp(-(TOLERANCE**2) / (2.0 * np.maximum(spread, 1e-6) ** 2))


def sheet_quality(normals: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cover, roughness and curl of the accepted normals (H, W, 3; NaN where there are none), each (H, W) float.

    Cover: share of the neighbourhood (a tenth of the inradius `scale`) that is accepted. Roughness: angle to the local
    mean normal in tolerances. Curl: |p_y - q_x| over the size of the gradients' Jacobian, 0 for a surface.
    """
    known = np.isfinite(normals[..., 0])
    cover = ndimage.gaussian_filter(known.astype(float), max(2.0, 0.08 * scale))
    weight = np.maximum(ndimage.gaussian_filter(known.astype(float), 2.0), 1e-6)

    def local_mean(values: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(np.where(known, values, 0.0), 2.0) / weight

    mean = unit(np.stack([local_mean(normals[..., axis]) for axis in range(3)], axis=-1))
    roughness = np.radians(angles(normals, mean)) / TOLERANCE
    (p_down, p_x), (q_down, q_x) = (np.gradient(local_mean(g)) for g in gradients(normals))
    jacobian = np.sqrt(p_x**2 + p_down**2 + q_x**2 + q_down**2)
    curl = np.abs(-p_down - q_x) / (jacobian + 1e-3)
    return cover, roughness, curl


def observed_confidence(normals: np.ndarray, scale: float) -> np.ndarray:
    """Confidence (H, W) of accepted normals (H, W, 3; NaN elsewhere) by their neighbourhood; NaN where is none."""
    return _logistic(OBSERVED_WEIGHTS, *sheet_quality(normals, scale))


def sheet_confidence(normals: np.ndarray, shape: np.ndarray, surprise: np.ndarray, scale: float) -> np.ndarray:
    """Confidence (H, W) of accepted normals (H, W, 3; NaN elsewhere) by their sheets; NaN where there are none.

    shape (H, W): mean of the sheet's `shape_evidence`; surprise (H, W): see `connected_sheets`.
    """
    _, roughness, curl = sheet_quality(normals, scale)
    return _logistic(SHEET_WEIGHTS, roughness, np.minimum(curl, 2.0), shape, surprise)


def _logistic(weights: tuple[float, ...], *cues: np.ndarray) -> np.ndarray:
    logit = weights[0] + sum(weight * cue for weight, cue in zip(weights[1:], cues, strict=True))
    return np.asarray(1.0 / (1.0 + np.exp(-logit)))


def field_growth(predict: Callable[[np.ndarray], np.ndarray], normals: np.ndarray, scale: float) -> float:
    """How fast the field's error grows with the distance from accepted normals on this object, radians per pixel.

    predict(known (H, W) bool) -> field (H, W, 3) from these accepted normals (H, W, 3; NaN elsewhere) and the rim.
    Chequered blocks of a quarter inradius are withheld in turn. With nothing to withhold: 150 degrees an inradius.
    """
    known = np.isfinite(normals[..., 0])
    block = max(4, round(0.25 * scale))
    rows, columns = np.indices(known.shape) // block
    ratios = []
    for parity in (0, 1):
        kept = known & ((rows + columns) % 2 == parity)
        tested = known & ~kept
        if not (kept.any() and tested.any()):
            continue
        distance = ndimage.distance_transform_edt(~kept)[tested]
        error = np.radians(angles(predict(kept)[tested], normals[tested]))
        ratios.append(error / (distance + 2.0))
    if not ratios:
        return np.radians(150.0) / scale
    return float(np.quantile(np.concatenate(ratios), 0.9)) / RAYLEIGH_NINTH_DECILE


def field_confidence(known: np.ndarray, rim: np.ndarray, growth: float, scale: float) -> np.ndarray:
    """Confidence (H, W) of the field between accepted pixels `known` and rim pixels `rim` (H, W bool each).

    growth: `field_growth`, radians per pixel; scale: the inradius in pixels. Full confidence needs accepted normals all
    around; towards the rim it is extrapolation and no surer than that the rim is an occluding contour.
    """

    def reached_from(places: np.ndarray) -> np.ndarray:
        if not places.any():
            return np.zeros(places.shape)
        return within_tolerance(growth * (ndimage.distance_transform_edt(~places) + 2.0))

    around = np.minimum(1.3 * ndimage.gaussian_filter(known.astype(float), max(2.0, 0.08 * scale)), 1.0)
    inside = RIM_TRUST + (1.0 - RIM_TRUST) * around
    return np.maximum(inside * reached_from(known), RIM_TRUST * reached_from(rim))
