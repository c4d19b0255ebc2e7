"""Distance of a near light from the parallax between chrome spheres, frame by frame.

Triangulation of the light from highlights on several spheres: Powell et al. 2001. To first order the direction to the
light differs between two places by their distance across the light, times its inverse distance, so the inverse distance
is found by linear least squares, repeated at the solution (Gauss-Newton). An error of a sphere's centre rotates all its
normals alike; two unknowns for each sphere take it up.

A light in a hand comes nearer and goes farther. Where that explains the parallax better than one distance does, the
inverse distance follows the frames, smoothed by a penalty on its steps whose weight is chosen by cross-validation
(Craven and Wahba 1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import component_derivatives, half_vectors_of, unit
from glint.tasks.algorithms.near_light.positions import SphereLights

MIN_SHARED_FRAMES = 20
"""Frames that two spheres must share."""
MIN_SPAN_PX = 1.0
"""Distance of the spheres' reflecting points below which they stand at one place and show no parallax."""
MIN_SIGNIFICANCE = 5.0
"""Standard errors by which the inverse distance must exceed zero."""
MIN_PARALLAX_DEG = 0.3
"""Difference between the spheres' directions to the light below which it counts as distant."""
GAUSS_NEWTON_STEPS = 6
"""Steps in which one distance of all frames and the rotations are solved."""
ALTERNATIONS = 4
"""Times that a varying distance and the rotations are fitted in turn."""
MAX_INVERSE_DISTANCE_SPAN = 1.5
"""Largest inverse distance, times the spheres' span, that a step may reach: nearer lights stand between the spheres."""
MIN_INVERSE_RATIO, MAX_INVERSE_RATIO = 0.3, 3.0
"""Bounds of a frame's inverse distance, relative to the one that fits all frames."""
SMOOTHING_FRAMES = (4.0, 12.0, 36.0, 108.0)
"""Lengths, in frames, that are tried for the smoothing of a varying distance."""
HELD_OUT_FRAMES = 8
"""Length of the blocks of frames that cross-validation withholds in turn; neighbouring frames err alike."""
MIN_VALIDATION_GAIN = 0.1
"""Share by which a varying distance must lower the held-out residual."""


@dataclass(frozen=True, slots=True)
class LightDistance:
    """Distance of a near light from the reference point.

    inverse_distance (T,): 1/pixels. standard_error: of their mean, 1/pixels. varies: whether they differ. rotations
    (S, 2): error of each sphere's n_x and n_y, as of a wrong centre, relative to the mean of all spheres.
    """

    inverse_distance: np.ndarray
    standard_error: float
    varies: bool
    rotations: np.ndarray


@dataclass(frozen=True, slots=True)
class Parallax:
    """One inverse distance of all frames: 1/pixels, 0 for a distant light; its standard_error; rotations (S, 2): see
    `LightDistance`; span: mean distance of the spheres' reflecting points, pixels; shared (T,) bool: the frames."""

    inverse_distance: float
    standard_error: float
    rotations: np.ndarray
    span: float
    shared: np.ndarray


def fit_parallax(sites: Sequence[SphereLights]) -> Parallax | None:
    """Fit the inverse distance of a light and the spheres' rotations.

    None if no two spheres share enough frames, or if all stand at one place.
    """
    lights, positions, accepted = _stacked(sites)
    shared = accepted.sum(axis=0) > 1
    if shared.sum() < MIN_SHARED_FRAMES:
        return None
    lights, positions, accepted = lights[:, shared], positions[:, shared], accepted[:, shared]
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    in_common = np.isfinite(distances).any(axis=-1)
    span = float(np.nanmean(distances[in_common], axis=-1).max())
    if span < MIN_SPAN_PX:
        return None
    inverse, rotations, error = 0.0, np.zeros((len(sites), 2)), 0.0
    for _ in range(GAUSS_NEWTON_STEPS):
        everywhere = np.full(lights.shape[1], inverse)
        change, turns, error = _step(lights, positions, accepted, everywhere, rotations)
        inverse = float(np.clip(inverse + change, 0.0, MAX_INVERSE_DISTANCE_SPAN / span))
        rotations = rotations + turns
    return Parallax(inverse, error, rotations, span, shared)


def triangulate(sites: Sequence[SphereLights], weights: np.ndarray | None = None) -> LightDistance | None:
    """Estimate a light's inverse distance; None if it is distant, or if the spheres show no parallax.

    weights (S,): shares of the spheres in the mean of their rotations, which shows in no parallax; None: the same.
    """
    fit = fit_parallax(sites)
    if (
        fit is None
        or fit.inverse_distance < MIN_SIGNIFICANCE * fit.standard_error
        or np.degrees(fit.inverse_distance * fit.span) < MIN_PARALLAX_DEG
    ):
        return None
    lights, positions, accepted = (values[:, fit.shared] for values in _stacked(sites))
    inverse, rotations, varies = np.full(lights.shape[1], fit.inverse_distance), fit.rotations, False
    for _ in range(ALTERNATIONS):
        residuals, by_inverse, _ = _linearized(lights, positions, accepted, inverse, rotations)
        changes = _smooth_change(residuals, by_inverse)
        if changes is None:
            break
        varies = True
        least, most = MIN_INVERSE_RATIO * fit.inverse_distance, MAX_INVERSE_RATIO * fit.inverse_distance
        inverse = np.clip(inverse + changes, least, most)
        # What one distance left of the variation has bent the rotations.
        change, turns, _ = _step(lights, positions, accepted, inverse, rotations)
        inverse, rotations = inverse + change, rotations + turns
    varying = np.interp(np.arange(len(fit.shared)), np.flatnonzero(fit.shared), inverse)
    if weights is not None:
        rotations = rotations - weights @ rotations
    return LightDistance(varying, fit.standard_error, varies, rotations)


def _stacked(sites: Sequence[SphereLights]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lights (S, T, 3) and positions (S, T, 3) of all spheres, and where there are any (S, T)."""
    lights = np.stack([site.lights for site in sites])
    return lights, np.stack([site.positions for site in sites]), np.isfinite(lights[..., 0])


def rotated(lights: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return light directions (T, 3) without the error (2,) of the sphere's n_x and n_y."""
    return unit(lights - _rotation_columns(half_vectors_of(lights)) @ rotation)


def _step(
    lights: np.ndarray, positions: np.ndarray, accepted: np.ndarray, inverse: np.ndarray, rotations: np.ndarray
) -> tuple[float, np.ndarray, float]:
    """Return a Gauss-Newton step from a solution (T,) and (S, 2), see `_linearized`.

    It is the change of all inverse distances, 1/pixels, that of the rotations (S, 2), and the first's standard error.
    """
    residuals, by_inverse, by_rotation = _linearized(lights, positions, accepted, inverse, rotations)
    matrix = np.concatenate([by_inverse[..., None], by_rotation], axis=-1).reshape(-1, 1 + 2 * len(lights))
    solution, error = _robust_solution(matrix, residuals.ravel(), np.repeat(accepted, 3))
    return float(solution[0]), solution[1:].reshape(-1, 2), error


def _linearized(
    lights: np.ndarray, positions: np.ndarray, accepted: np.ndarray, inverse: np.ndarray, rotations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return residuals (S, T, 3) of the directions, and their derivatives by inverse distance (S, T, 3) and rotations
    (S, T, 3, 2 S), at a solution (T,) and (S, 2); zero where a sphere shows no light.

    The light's direction from the reference point is eliminated: it is the mean of what all spheres show.
    """
    count, on = len(lights), accepted[..., None]
    columns = _rotation_columns(half_vectors_of(np.where(on, lights, (0.0, 0.0, 1.0))))
    observed = np.where(on, lights, 0.0) - np.einsum("stij,sj->sti", columns, rotations)
    points = np.where(on, positions, 0.0)
    weight = accepted / accepted.sum(axis=0)

    def across(values: np.ndarray) -> np.ndarray:
        """Return values (S, T, 3, ...) without their mean over the spheres."""
        extra = (None,) * (values.ndim - 2)
        return np.where(accepted[(..., *extra)], values - (weight[(..., *extra)] * values).sum(axis=0), 0.0)

    # Seen from a point q, the light is in direction u - w q, of length |u - w q|: u is its direction, w its inverse
    # distance from the reference point.
    length = np.ones((*lights.shape[:2], 1))
    for _ in range(3):
        reference = unit((weight[..., None] * (length * observed + inverse[:, None] * points)).sum(axis=0))
        length = np.linalg.norm(reference - inverse[:, None] * points, axis=-1, keepdims=True)
    predicted = (reference - inverse[:, None] * points) / length
    by_inverse = -(points - (points * predicted).sum(axis=-1, keepdims=True) * predicted) / length
    by_rotation = np.zeros((*lights.shape, count, 2))
    for number in range(count):
        by_rotation[number, :, :, number] = columns[number]
    # A rotation of all spheres together is no difference between them: it is taken out, so that it remains zero.
    by_rotation -= by_rotation.mean(axis=3, keepdims=True)
    return across(observed - predicted), across(by_inverse), across(by_rotation.reshape(*lights.shape, 2 * count))


def _robust_solution(matrix: np.ndarray, residuals: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, float]:
    """Solve least squares without residuals beyond three robust standard deviations.

    Returns:
        The solution of least norm, since a rotation of all spheres together shows in no residual, and the standard
        error of its first unknown.
    """
    inliers = used
    for _ in range(3):
        solution = np.linalg.lstsq(matrix[inliers], residuals[inliers], rcond=1e-9)[0]
        remaining = residuals - matrix @ solution
        deviation = robust_deviation(remaining[inliers]) + 1e-9
        inliers = used & (np.abs(remaining) < 3.0 * deviation)
    covariance = np.linalg.pinv(matrix[inliers].T @ matrix[inliers], rcond=1e-9, hermitian=True)
    return solution, deviation * float(np.sqrt(max(covariance[0, 0], 0.0))) + 1e-9


def _smooth_change(residuals: np.ndarray, by_inverse: np.ndarray) -> np.ndarray | None:
    """Return by how much each frame's inverse distance (T,) changes; None if one change of all predicts about as well.

    residuals, by_inverse: (S, T, 3), at the present inverse distances.
    """
    weight = (by_inverse**2).sum(axis=(0, 2))
    estimate = (by_inverse * residuals).sum(axis=(0, 2)) / np.maximum(weight, 1e-12)
    # One wrong highlight must not bend the whole path.
    deviation = robust_deviation(estimate - np.median(estimate)) + 1e-12
    weight = np.where(np.abs(estimate - np.median(estimate)) < 4.0 * deviation, weight, 0.0)
    blocks = np.arange(len(weight)) // HELD_OUT_FRAMES

    def held_out(length: float) -> float:
        error = 0.0
        for fold in range(4):
            tested = blocks % 4 == fold
            smooth = _smoothed(estimate, np.where(tested, 0.0, weight), length)
            error += float((weight[tested] * (estimate[tested] - smooth[tested]) ** 2).sum())
        return error

    errors = {length: held_out(length) for length in SMOOTHING_FRAMES}
    best = min(errors, key=lambda length: errors[length])
    constant = float((weight * (estimate - (weight * estimate).sum() / weight.sum()) ** 2).sum())
    return _smoothed(estimate, weight, best) if errors[best] < (1.0 - MIN_VALIDATION_GAIN) * constant else None


def _smoothed(values: np.ndarray, weight: np.ndarray, length: float) -> np.ndarray:
    """Return the sequence (T,) that fits weighted values (T,) with the least steps: smooth over `length` frames."""
    penalty = float(np.median(weight[weight > 0])) * length**2
    diagonal = weight + 2.0 * penalty
    diagonal[[0, -1]] -= penalty
    banded = np.stack([np.full(len(values), -penalty), diagonal])
    banded[0, 0] = 0.0
    return np.asarray(solveh_banded(banded, weight * values))


def _rotation_columns(normal: np.ndarray) -> np.ndarray:
    """Return the derivatives (..., 3, 2) of light directions by an error of the normals' (..., 3) n_x and n_y."""
    tangents = component_derivatives(normal)
    return np.asarray(2.0 * (normal[..., 2:, None] * tangents + tangents[..., 2:, :] * normal[..., None]))
