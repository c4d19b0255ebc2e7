"""Confidence: the probability that a pixel's normal is within 5 degrees of the truth. The paper gives none.

An observed normal is wrong if its sheet is. Logistic regressions fitted to simulated captures judge that by the
roughness of the normals, by curl (a normal field's gradients have none; half vectors of internal paths have), by the
evidence of shape and shading, by the held-out residual (`final_confidence`), and by how much of what the object shows
is accepted at all. Where the surface turns by degrees from pixel to pixel, it also matters which place within the pixel
showed the light. While labels still change, only neighbourhood cues are used. Between observations the field is trusted
as far as it proves itself by cross-validation: blocks of accepted normals are held out, and its error is taken to grow
linearly with the distance from known pixels.
"""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.blur import gaussian_blur
from glint.tasks.algorithms.geometry.distance import distance_inside
from glint.tasks.algorithms.geometry.vectors import angles, gradients, unit

TOLERANCE_RAD = np.radians(5.0)
"""Error, radians, up to which a normal counts as right."""
NEIGHBOURHOOD_LOGIT = (2.5, 4.5, -1.2, -5.5)
"""Logit of an observed normal being right by its neighbourhood: constant, then cover, roughness, curl."""
SHEET_LOGIT = (3.85, -0.45, -0.6, 0.6, -1.05)
"""The same by its sheet: constant, then roughness, curl, the sheet's mean evidence and its held-out residual.

Fitted to 87 simulated captures of 500 to 1,200 frames of all shapes, beside `accepted_log_odds` and `place_confidence`.
"""
MAX_ACCEPTED_ODDS = 10.0
"""Bound of the ratio of accepted pixels to those whose candidates were all rejected: a higher one proves no more; it is
6.7 at most on the captures of the fit."""
OWN_ERROR_DEG = 1.0
"""Standard deviation per axis of the error that a confident normal has by itself: the median over 77 simulated captures
is 0.95."""
PLACE_SCALE_PX = 0.14
"""Scale, in pixels, of the t distribution of the place that showed an accepted normal, about the middle of its pixel:
fitted to the share of confident normals that is wrong, by the turn of the surface, on 45 simulated captures."""
FACE_CONFIDENCE, FACE_RESIDUAL_SCALE = 0.99, 4.0
"""Confidence in a flat face whose creases agree with all its neighbours, and the standard deviation of the Gaussian by
which it falls with their residual: at a residual of 1 it is 0.96."""
SOLID_ANGLES_DEG, RIGHT_SHARES = (5.0, 7.0, 10.0), (1.0, 0.86, 0.81)
"""Angles between a solid of flat faces and confident normals, and the share of these that is right on 28 simulated
captures; smaller angles are as often those of a solid that is a little off."""
OCCLUDING_CONTOUR_SHARE = 0.7
"""Share of silhouettes that are occluding contours and not creases or cuts; bounds confidence in extrapolation."""
DEFAULT_SLOPE_DEG = 150.0
"""Error-model slope, degrees per inradius, of an object on which nothing can be held out."""
COVER_INRADII, MIN_COVER_PX = 0.08, 2.0
"""Standard deviation of the window over which known pixels are counted, in inradii, and at least, in pixels."""
LOCAL_MEAN_PX, CURL_FLOOR = 2.0, 1e-3
"""Standard deviation in pixels of the local means by which roughness and curl are measured, and what is added to the
norm of the gradients' Jacobian, per pixel, so that nearly flat sheets have no curl."""
MAX_CURL = 2.0
"""Bound of the curl by which a sheet is judged."""
FULL_COVER_RATIO = 1.3
"""Factor of the cover, so that a pixel counts as surrounded before all of its window is known."""
BLOCK_INRADII = 0.25
"""Side of the held-out blocks, in inradii."""
MIN_DISTANCE_PX = 2.0
"""Added to the distance from known pixels, in pixels: the error does not vanish beside them."""
RAYLEIGH_NINTH_DECILE = 2.146
"""Ninth decile of an angular error in standard deviations per axis, sqrt(2 ln 10)."""


def probability_within_tolerance(spread: np.ndarray) -> np.ndarray:
    """Return the probability that an error of standard deviation `spread` (radians, per axis) is below 5 degrees.

    The two components of an angular error are normal, so its size has a Rayleigh distribution.
    """
    return 1.0 - np.exp(-(TOLERANCE_RAD**2) / (2.0 * np.maximum(spread, 1e-6) ** 2))


def sheet_quality(normals: np.ndarray, inradius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measure cover, roughness and curl of accepted normals.

    Args:
        normals: (H, W, 3), camera frame, NaN where there is none.
        inradius: of the object, in pixels.

    Returns:
        (H, W) each. Cover: share of the neighbourhood (COVER_INRADII) that is accepted. Roughness: angle to the local
        mean normal, in tolerances. Curl: |p_y - q_x| over the norm of the gradients' Jacobian, to which CURL_FLOOR is
        added; 0 for a surface.
    """
    known = np.isfinite(normals[..., 0])
    cover = gaussian_blur(known, max(MIN_COVER_PX, COVER_INRADII * inradius))
    weight = np.maximum(gaussian_blur(known, LOCAL_MEAN_PX), 1e-6)

    # Normalised convolution: gaps neither pull the mean nor spread.
    def local_mean(values: np.ndarray) -> np.ndarray:
        return gaussian_blur(np.where(known, values, 0.0), LOCAL_MEAN_PX) / weight

    mean = unit(np.stack([local_mean(normals[..., axis]) for axis in range(3)], axis=-1))
    roughness = np.radians(angles(normals, mean)) / TOLERANCE_RAD
    # Rows run downwards and y upwards, so p_y = -p_down.
    (p_down, p_x), (q_down, q_x) = (np.gradient(local_mean(gradient)) for gradient in gradients(normals))
    jacobian = np.sqrt(p_x**2 + p_down**2 + q_x**2 + q_down**2)
    curl = np.abs(-p_down - q_x) / (jacobian + CURL_FLOOR)
    return cover, roughness, curl


def observed_confidence(normals: np.ndarray, inradius: float) -> np.ndarray:
    """Return the confidence (H, W) of accepted normals (H, W, 3; NaN elsewhere) by their neighbourhood, NaN elsewhere.

    inradius: of the object, in pixels.
    """
    return _logistic(NEIGHBOURHOOD_LOGIT, *sheet_quality(normals, inradius))


def sheet_confidence(
    normals: np.ndarray, evidence: np.ndarray, residual: np.ndarray, inradius: float, accepted_odds: float
) -> np.ndarray:
    """Return the confidence (H, W) of accepted normals (H, W, 3; NaN elsewhere) by their sheets, NaN elsewhere.

    evidence (H, W): the sheet's mean log-likelihood ratio by shape, shading, marks and refuted faces; residual (H, W):
    its `held_out_residual`; inradius: of the object, in pixels; accepted_odds: `accepted_log_odds` of the object, nats.
    """
    _, roughness, curl = sheet_quality(normals, inradius)
    return _logistic(SHEET_LOGIT, roughness, np.minimum(curl, MAX_CURL), evidence, residual, offset=accepted_odds)


def accepted_log_odds(accepted: np.ndarray, has_candidate: np.ndarray) -> float:
    """Return the log odds that an accepted normal is right, by how much of what the object shows is accepted, nats.

    By chance, a share of all false candidates agrees with the field and is accepted. Pixels whose candidates were all
    rejected show how many false ones there are; so the odds of right against wrong among the accepted are, up to a
    factor, the ratio of accepted to rejected pixels (the target-decoy estimate of the false discovery rate, Elias and
    Gygi 2007: what is known to be false tells how much of what is accepted is false).

    accepted, has_candidate: (H, W) bool, pixels with an accepted normal, and with any candidate.
    """
    rejected = max(int((has_candidate & ~accepted).sum()), 1)
    return float(np.log(np.clip(int(accepted.sum()) / rejected, 1e-6, MAX_ACCEPTED_ODDS)))


def place_confidence(normals: np.ndarray) -> np.ndarray:
    """Return the probability (H, W) that the normal in the middle of a pixel is within 5 degrees of the one observed.

    A candidate is the normal of the place that flashed, somewhere in or beside the pixel, and between there and the
    middle the surface turns. Places are distributed with heavy tails, by Student's t with two degrees of freedom: of
    confident normals of simulated captures 0.2% are wrong where the surface turns by less than 2 degrees per pixel, 4%
    at 7 degrees, and 13% at 15.

    normals: (H, W, 3) unit, camera frame, NaN outside the object, towards which nothing is taken to turn.
    """
    turn = np.zeros((2, *normals.shape[:2]))
    turn[0, 1:-1] = angles(normals[2:], normals[:-2]) / 2.0
    turn[1, :, 1:-1] = angles(normals[:, 2:], normals[:, :-2]) / 2.0
    # The turn's mean square over all directions is half of its sum along rows and columns.
    square = (np.radians(np.nan_to_num(turn)) ** 2).sum(axis=0) / 2.0
    # Of a t distribution in the plane with n degrees of freedom, (1 + r^2 / (n s^2))^(-n/2) lies beyond r.
    beyond = 1.0 / (1.0 + TOLERANCE_RAD**2 / np.maximum(2.0 * PLACE_SCALE_PX**2 * square, 1e-12))
    return np.asarray(1.0 - beyond)


def solid_confidence(normals: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """Return the probability (H, W) that accepted normals are right by their angle to those of a solid, all (H, W, 3).

    What is seen through the flat faces of a solid is smooth too, and agrees with the field that it pulls to itself.
    """
    return np.asarray(np.interp(angles(normals, solid), SOLID_ANGLES_DEG, RIGHT_SHARES))


def face_confidence(residual: np.ndarray) -> np.ndarray:
    """Return the confidence of observed flat faces by the RMS residual (...) of two or more independent creases.

    NaN without them: paths that cross the glass along a single crease give false faces that agree with it exactly.
    """
    return np.asarray(FACE_CONFIDENCE * np.exp(-np.square(residual) / (2.0 * FACE_RESIDUAL_SCALE**2)))


def _logistic(weights: tuple[float, ...], *cues: np.ndarray, offset: float = 0.0) -> np.ndarray:
    """Return the probability (...) of a logit: an offset, a constant, and cues (...) times the rest of the weights."""
    logit = offset + weights[0] + sum(weight * cue for weight, cue in zip(weights[1:], cues, strict=True))
    return np.asarray(1.0 / (1.0 + np.exp(-logit)))


def field_error_slope(predict: Callable[[np.ndarray], np.ndarray], normals: np.ndarray, inradius: float) -> float:
    """Estimate how fast the field's error grows with the distance from accepted normals, by two-fold cross-validation.

    The folds are the two colours of a chequerboard of blocks.

    Args:
        predict: maps known pixels (H, W) bool to the field (H, W, 3) from these normals and the occluding contour.
        normals: (H, W, 3) accepted normals, NaN elsewhere.
        inradius: of the object, in pixels.

    Returns:
        Standard deviation per axis, radians per pixel; DEFAULT_SLOPE_DEG per inradius if nothing can be held out.
    """
    known = np.isfinite(normals[..., 0])
    block = max(4, round(BLOCK_INRADII * inradius))
    rows, columns = np.indices(known.shape) // block
    ratios = []
    for parity in (0, 1):
        kept = known & ((rows + columns) % 2 == parity)
        tested = known & ~kept
        if not (kept.any() and tested.any()):
            continue
        distance = distance_inside(~kept)[tested]
        error = np.radians(angles(predict(kept)[tested], normals[tested]))
        ratios.append(error / (distance + MIN_DISTANCE_PX))
    if not ratios:
        return np.radians(DEFAULT_SLOPE_DEG) / inradius
    # A quantile instead of the RMS is robust against the false normals among the tested.
    return float(np.quantile(np.concatenate(ratios), 0.9)) / RAYLEIGH_NINTH_DECILE


def with_input_doubt(confidence: np.ndarray, half_vector_sd: np.ndarray, silhouette_doubt: np.ndarray) -> np.ndarray:
    """Return the confidence (H, W) float32 when the inputs that all normals share may be wrong.

    A normal within tolerance by its own evidence stays so if its own error and that of the half vectors together do not
    exceed the tolerance, and if the silhouette is true. The three are taken as independent.

    Args:
        confidence: (H, W), by the evidence of labels and field.
        half_vector_sd: (H, W) radians, standard deviation per axis of the error that the half vectors share.
        silhouette_doubt: (H, W), probability that a normal is wrong because the silhouette is.
    """
    own = np.radians(OWN_ERROR_DEG)
    within = probability_within_tolerance(np.hypot(own, half_vector_sd)) / probability_within_tolerance(own)
    return np.asarray(confidence * within * (1.0 - silhouette_doubt), np.float32)


def field_confidence(known: np.ndarray, rim: np.ndarray, slope: float, inradius: float) -> np.ndarray:
    """Return the confidence (H, W) of the field between accepted pixels and the occluding contour.

    Full confidence needs accepted normals all around; towards the contour the field is extrapolated, and no better
    known than that the silhouette is an occluding contour.

    Args:
        known, rim: (H, W) bool, accepted pixels and the occluding contour.
        slope: `field_error_slope`, radians per pixel.
        inradius: of the object, in pixels.
    """

    def confidence_from(sources: np.ndarray) -> np.ndarray:
        if not sources.any():
            return np.zeros(sources.shape)
        distance = distance_inside(~sources) + MIN_DISTANCE_PX
        return probability_within_tolerance(slope * distance)

    surrounded = np.minimum(FULL_COVER_RATIO * gaussian_blur(known, max(MIN_COVER_PX, COVER_INRADII * inradius)), 1.0)
    inside = OCCLUDING_CONTOUR_SHARE + (1.0 - OCCLUDING_CONTOUR_SHARE) * surrounded
    return np.maximum(inside * confidence_from(known), OCCLUDING_CONTOUR_SHARE * confidence_from(rim))
