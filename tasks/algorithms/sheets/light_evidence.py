"""Tests of known lights by the candidate normals that they give: other axes, a turn, shifted frames, half vectors.

Candidates made with right lights hold a sheet that integrates (Frankot and Chellappa 1988) and bends away from the
view towards the silhouette, as the field from the occluding contour does. Lights with another convention of axes mirror
or turn that sheet. A turn by an angle about the view vector multiplies the gradients of a surface z by a rotation, so
their curl becomes sin(angle) times the Laplacian of z, and their divergence cos(angle) times it: the ratio of the two
is the tangent of the angle. Lights that are early or late by some frames of a spiral turn the normals too. Where a file
holds half vectors, normals seem to be slanted half as much as they are, at most 22.5 degrees.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.sheets.integrability import shape_log_ratio, sheet_jacobian, window_step

AXES: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = MappingProxyType(
    {
        "as given": ((1, 0), (0, 1)),
        "x negated": ((-1, 0), (0, 1)),
        "y negated": ((1, 0), (0, -1)),
        "x and y negated": ((-1, 0), (0, -1)),
        "x and y exchanged": ((0, 1), (1, 0)),
        "x and y exchanged and negated": ((0, -1), (-1, 0)),
        "turned by 90 degrees counter-clockwise": ((0, -1), (1, 0)),
        "turned by 90 degrees clockwise": ((0, 1), (-1, 0)),
    }
)
"""Changes of x and y of the given lights, by name: the conventions of other programs."""
AS_GIVEN, OPPOSITE = "as given", "x and y negated"
"""Names of the axes that nothing changes, and of those that turn the normals by half a turn."""
SILHOUETTE_ERROR_DEG = 15.0
"""Standard deviation in degrees of exterior normals about the field from the occluding contour."""
MIN_AXES_RATIO = 1.1
"""Score of other axes, relative to that of the given ones, from which the given ones are contradicted. On simulated and
rendered captures with right lights it is 0.2 to 0.85 (`python -m tests.benchmarks.light_evidence`)."""
MIN_OPPOSITE_RATIO = 1.6
"""The same for both axes negated: highlights of a rear wall, as concave as the front is convex, reach 1.2."""
MAX_HALVED_SLANT_DEG, SLANT_QUANTILE = 24.0, 0.99
"""Slant in degrees which this quantile of the candidates' slants exceeds, unless the lights are half vectors, or none
was more than 45 degrees from the view axis."""
MIN_HALF_RATIO = 1.7
"""Score of the lights as half vectors, relative to that as given, from which they are half vectors. 316 simulated
captures have 0.1 to 1.6 with right lights up to 45 degrees from the view axis; with half vectors, 68% of them have 1.5
and more."""
MIN_TURN_DEG, MIN_TURN_ERRORS = 3.0, 3.0
"""Turn of the normals that contradicts the lights, in degrees and in standard errors; right lights show up to 1.5."""
TURN_BLOCKS = 6
"""Blocks along each side of the region between which the turn's standard error is estimated."""


@dataclass(frozen=True, slots=True)
class LightEvidence:
    """Evidence of the candidates on the lights.

    axes: name of the change of axes, of AXES without AS_GIVEN, that fits best.
    axes_ratio: its score, relative to that of the given axes.
    turn_deg, turn_error_deg: turn of the accepted normals about the view vector, and its standard error.
    log_ratio: mean over the pixels of the highest log-likelihood ratio of a candidate, exterior against false, by the
        shape of its sheet, nats; NaN without candidates.
    half_ratio: score of the given lights as half vectors, relative to that as lights; 0: they cannot be half vectors.
    """

    axes: str
    axes_ratio: float
    turn_deg: float
    turn_error_deg: float
    log_ratio: float
    half_ratio: float = 0.0

    @property
    def has_other_axes(self) -> bool:
        """True if other axes than the given ones fit."""
        return self.axes_ratio >= (MIN_OPPOSITE_RATIO if self.axes == OPPOSITE else MIN_AXES_RATIO)

    @property
    def has_half_vectors(self) -> bool:
        """True if the given lights are half vectors."""
        return self.half_ratio >= MIN_HALF_RATIO

    @property
    def is_turned(self) -> bool:
        """True if the normals are turned."""
        return abs(self.turn_deg) > max(MIN_TURN_DEG, MIN_TURN_ERRORS * self.turn_error_deg)

    @property
    def has_no_surface(self) -> bool:
        """True if the candidates look less like a surface than like none."""
        return self.log_ratio < 0.0


def light_evidence(
    candidates: np.ndarray, labels: np.ndarray, expected: np.ndarray, observed: np.ndarray, inradius: float
) -> LightEvidence:
    """Compare candidates and accepted normals with what right lights give.

    Args:
        candidates: (K, H, W, 3) unit, as seen along the view vectors, NaN where there is none.
        labels: (K, H, W), 1: accepted.
        expected: (H, W, 3), field from the occluding contour, seen alike.
        observed: (H, W) bool, pixels of the mask with candidates.
        inradius: of the mask, in pixels.
    """
    ratios, scores = {}, {}
    for name, matrix in AXES.items():
        turned = candidates.astype(np.float32)
        turned[..., :2] = candidates[..., :2] @ np.array(matrix, np.float32).T
        ratios[name] = shape_log_ratio(turned, inradius)
        scores[name] = _agreement(turned, ratios[name], expected, observed)
    best = max((name for name in AXES if name != AS_GIVEN), key=lambda name: scores[name])
    half_score = 0.0
    if _max_slant(candidates) < MAX_HALVED_SLANT_DEG:
        doubled = _with_double_slant(candidates.astype(np.float32))
        half_score = _agreement(doubled, shape_log_ratio(doubled, inradius), expected, observed)
    turn, error = turn_angle(np.where((labels > 0)[..., None], candidates, np.nan).astype(np.float32), inradius)
    given_score = max(scores[AS_GIVEN], 1e-6)
    log_ratio = _mean_best(ratios[AS_GIVEN], observed)
    return LightEvidence(best, scores[best] / given_score, turn, error, log_ratio, half_score / given_score)


def turn_angle(accepted: np.ndarray, inradius: float) -> tuple[float, float]:
    """Return the turn in degrees of accepted normals (K, H, W, 3) about the view vector, counter-clockwise.

    With it its standard error, the jackknife's over blocks of the region. NaN where too few normals are accepted. A
    hollow counts as turned by half a turn, which its normals cannot tell from it.
    """
    curl, _, convexity = np.moveaxis(sheet_jacobian(accepted, window_step(inradius)), -1, 0)
    height, width = accepted.shape[1:3]
    rows, columns = np.indices((height, width))
    block = (rows * TURN_BLOCKS // height) * TURN_BLOCKS + columns * TURN_BLOCKS // width
    # As every sum runs over the same nodes, the size of the Laplacian cancels in the ratio.
    sums = [
        np.bincount(block.ravel(), np.nansum(values, axis=0).ravel(), TURN_BLOCKS**2) for values in (curl, convexity)
    ]
    curls, convexities = (values[(sums[0] != 0.0) | (sums[1] != 0.0)] for values in sums)
    if len(curls) < 2:
        return float("nan"), float("nan")
    turn = np.degrees(np.arctan2(curls.sum(), convexities.sum()))
    without = np.degrees(np.arctan2(curls.sum() - curls, convexities.sum() - convexities))
    spread = (without - turn + 180.0) % 360.0 - 180.0
    error = np.sqrt((len(curls) - 1) / len(curls) * (spread**2).sum())
    return float(turn), float(error)


def _max_slant(candidates: np.ndarray) -> float:
    """Return the largest slant, in degrees, of candidates (K, H, W, 3) but for outliers; infinite without any."""
    cosines = candidates[..., 2][np.isfinite(candidates[..., 2])]
    if not cosines.size:
        return float("inf")
    return float(np.degrees(np.arccos(np.clip(np.quantile(cosines, 1.0 - SLANT_QUANTILE), -1.0, 1.0))))


def _with_double_slant(normals: np.ndarray) -> np.ndarray:
    """Return normals (.., 3) slanted twice as much from the view vector, NaN where that is away from the camera."""
    reflected = 2.0 * normals[..., 2:] * normals - np.array([0.0, 0.0, 1.0], normals.dtype)
    return np.where(reflected[..., 2:] > 1e-3, reflected, np.float32(np.nan))


def _agreement(candidates: np.ndarray, ratio: np.ndarray, expected: np.ndarray, observed: np.ndarray) -> float:
    """Return how well the best candidate of each pixel is part of a surface and follows the silhouette, 0 to 1.

    Pixels count by the slant of the expected normal: one that faces the camera is the same under all axes.
    """
    error = angles(candidates, expected[None])
    follows = np.where(np.isfinite(error), np.exp(-(error**2) / (2.0 * SILHOUETTE_ERROR_DEG**2)), 0.0)
    exterior = np.where(np.isfinite(ratio), 1.0 / (1.0 + np.exp(-np.nan_to_num(ratio))), 0.0)
    slant = np.hypot(expected[..., 0], expected[..., 1])[observed]
    return float(((exterior * follows).max(axis=0)[observed] * slant).sum() / max(slant.sum(), 1e-9))


def _mean_best(ratio: np.ndarray, observed: np.ndarray) -> float:
    """Return the mean of the pixels' highest ratios (K, H, W), NaN without any."""
    best = np.where(np.isfinite(ratio), ratio, -np.inf).max(axis=0)[observed]
    known = best[np.isfinite(best)]
    return float(known.mean()) if known.size else float("nan")
