"""The contour of a chrome sphere, fitted to many frames at once, with its uncertainty.

A chrome sphere mirrors the table beside it, so its contour can vanish in a single picture, but not in all frames: the
light moves, and with it shadows and the brightness of what the rim mirrors. The frames are sampled along rays from an
approximate centre; where their levels change along a ray, frame by frame, is evidence of an edge. All circles on a grid
are scored by the mean evidence along them (Daugman 1993), and the scores weighted as a posterior give mean and
covariance. The rim mirrors strongly compressed what lies beside the contour, so edges inside the contour are many and
may be stronger than the contour's own; outside there is nothing of the kind. Evidence therefore saturates, and that a
little farther out is subtracted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit

RAYS = 96
"""Rays from the centre."""
MIN_SPACING_PX, SPACING_RATIO = 0.5, 0.01
"""Distance of samples along a ray: at least so many pixels, and at least this share of the radius."""
MIN_CHANGE = 0.004
"""Lower bound of a frame's usual change of log levels per pixel along the rays, for frames without structure."""
HALF_FRAME_RATIO, HALF_MEAN_RATIO = 2.0, 4.0
"""Squared change, relative to the usual one, at which the evidence of a frame, and that of their mean, is one half."""
MEAN_WEIGHT = 0.6
"""Weight of the mean's evidence; the rest is that of single frames."""
VARIATION_WEIGHT, HALF_VARIATION_RATIO = 0.5, 4.0
"""Weight of the evidence of the variation over time, and the squared change, relative to the usual one, at which it is
one half."""
MIN_VARIATION_FRAMES = 6
"""Frames from which the variation over time counts."""
VARIATION_ARC_DEG = 15.0
"""Arc over which the variation is averaged."""
MIN_VARIATION, MIN_VARIATION_CHANGE = 0.01, 0.001
"""Standard deviations of log levels, and changes of their logarithm, below which there is only noise."""
VARIATION_SHIFT_PX = 0.5
"""Distance by which the strongest change of variation lies outside the contour."""
OUTER_GAP_PX, OUTER_WEIGHT = 3.0, 0.25
"""Distance outside an edge at which evidence counts against it, and its weight."""
INWARD_SHIFT_PX = 0.15
"""Distance by which the strongest change lies inside the contour: the rim mirrors the table's edge of the contour."""
SCORE_DEVIATION = 0.01
"""Difference of mean evidence that divides the posterior by e; chosen so that deviations match the errors
(`python -m tests.benchmarks.spheres_scenes`)."""
COARSE_STEP_RATIO, FINE_STEP_RATIO = 0.01, 0.0025
"""Steps of the grids of circles, in radii."""
FINE_REACH_RATIO = 0.035
"""Distance from the best coarse circle that the fine grid covers, in radii."""
OUTSIDE_RATIOS = 1.08, 1.25
"""Radii, relative to a circle's, between which there is no rounder edge if the circle is a contour."""
DEVIATION_FLOOR_RATIO = 0.002
"""Least standard deviation of centre and radius, in radii: half a step, and the shape of real spheres."""


@dataclass(frozen=True, slots=True)
class ContourFit:
    """Circle (x, y, radius) in pixels; covariance (3, 3) of the three; contrast: its mean evidence, at most 1, beyond
    that of the circles outside it; start_contrast: likewise, of the circle with which the fit began."""

    x: float
    y: float
    radius: float
    covariance: np.ndarray
    contrast: float
    start_contrast: float = 0.0


@dataclass(frozen=True, slots=True)
class EdgeEvidence:
    """Evidence of edges along rays from (x, y): evidence (A, N) at radii start + spacing * n, angles (A,), y down."""

    x: float
    y: float
    evidence: np.ndarray
    start: float
    spacing: float
    angles: np.ndarray

    def scores(self, offsets: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return the mean evidence (I, J, K) of circles with centres (x + offsets[i], y + offsets[j]), radii[k]."""
        return _circle_scores(self.evidence, self.start, self.spacing, self.angles, offsets, radii - INWARD_SHIFT_PX)


def edge_evidence(
    frames: Sequence[np.ndarray], x: float, y: float, min_radius: float, max_radius: float, rays: int = RAYS
) -> EdgeEvidence:
    """Measure the evidence of edges between two radii around (x, y).

    Args:
        frames: of `log_frames`, (H, W) each; what lies outside them is no evidence.
        x: column of the centre.
        y: row of the centre.
        min_radius: smallest radius of a contour in pixels.
        max_radius: largest radius.
        rays: number of rays.
    """
    spacing = max(MIN_SPACING_PX, SPACING_RATIO * min_radius)
    reach = max(1, round(1.0 / spacing))
    start = max(min_radius - (reach + 2) * spacing, spacing)
    radii = np.arange(start, max_radius + OUTER_GAP_PX + (reach + 2) * spacing, spacing)
    angles = 2.0 * np.pi * (np.arange(rays) + 0.5) / rays
    columns = (x + np.cos(angles)[:, None] * radii).astype(np.float32)
    rows = (y + np.sin(angles)[:, None] * radii).astype(np.float32)
    height, width = frames[0].shape
    valid = (columns >= 0) & (rows >= 0) & (columns <= width - 1) & (rows <= height - 1)
    valid[:, reach:-reach] &= valid[:, : -2 * reach] & valid[:, 2 * reach :]
    valid[:, :reach] = valid[:, -reach:] = False
    if not valid.any():
        return EdgeEvidence(x, y, np.zeros(valid.shape, np.float32), start, spacing, angles)
    levels = np.stack(
        [cv2.remap(frame, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for frame in frames]
    )
    evidence = _level_evidence(levels, valid, reach, spacing)
    if len(frames) >= MIN_VARIATION_FRAMES:
        varying = _variation_evidence(levels, valid, reach, spacing)
        evidence = (1.0 - VARIATION_WEIGHT) * evidence + VARIATION_WEIGHT * varying
    evidence[~valid] = 0.0
    gap = max(1, round(OUTER_GAP_PX / spacing))
    evidence[:, :-gap] -= OUTER_WEIGHT * evidence[:, gap:]
    return EdgeEvidence(x, y, evidence, start, spacing, angles)


def _level_evidence(levels: np.ndarray, valid: np.ndarray, reach: int, spacing: float) -> np.ndarray:
    """Return the evidence (A, N), 0..1, of changes of log levels (T, A, N) along the rays, frame by frame."""
    single, mean = np.zeros(valid.shape, np.float32), np.zeros(valid.shape, np.float32)
    for frame in levels:
        change = _change(frame, reach) / (2 * reach * spacing)
        usual = float(np.median(np.abs(change[valid][::3]))) + MIN_CHANGE
        square = np.minimum((change / usual) ** 2, 1e3)
        single += square / (square + HALF_FRAME_RATIO)
        mean += square
    single, mean = single / len(levels), mean / len(levels)
    return (1.0 - MEAN_WEIGHT) * single + MEAN_WEIGHT * mean / (mean + HALF_MEAN_RATIO)


def _variation_evidence(levels: np.ndarray, valid: np.ndarray, reach: int, spacing: float) -> np.ndarray:
    """Return the evidence (A, N), 0..1, of changes along the rays in how much log levels (T, A, N) vary over time.

    The table varies with the light and with shadows, what the rim mirrors of it less: haze and reflections of the room
    lie over it. Neighbouring rays are averaged, since the table's texture does not vary by itself.
    """
    rays = max(1, 2 * round(VARIATION_ARC_DEG * valid.shape[0] / 720.0) + 1)
    variation = np.log(levels.std(axis=0) + MIN_VARIATION)
    around = np.pad(variation, ((rays // 2, rays // 2), (0, 0)), mode="wrap")
    smooth = cv2.blur(around, (1, rays))[rays // 2 : rays // 2 + valid.shape[0]]
    change = _change(smooth, reach)
    square = (change / (float(np.median(np.abs(change[valid]))) + MIN_VARIATION_CHANGE)) ** 2
    evidence = square / (square + HALF_VARIATION_RATIO)
    # Beside an edge the quieter side takes part in the other's variation: the strongest change lies outside.
    return _shifted(evidence, np.full(len(evidence), VARIATION_SHIFT_PX / spacing))


def _change(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the differences of values (A, N) between `reach` samples farther out and farther in; 0 at the ends."""
    change = np.zeros_like(values)
    change[:, reach:-reach] = values[:, 2 * reach :] - values[:, : -2 * reach]
    return change


def radius_profile(evidence: EdgeEvidence, reach: float, radii: np.ndarray, step: float) -> np.ndarray:
    """Return for each radius (K,) the best circle's (offset x, offset y, score), (K, 3), among nearby centres."""
    offsets = np.arange(-reach, reach + 1e-6, step)
    scores = evidence.scores(offsets, radii).reshape(-1, len(radii))
    best = scores.argmax(axis=0)
    return np.stack(
        [offsets[best // len(offsets)], offsets[best % len(offsets)], scores[best, np.arange(len(radii))]], axis=1
    )


def fit_contour(
    frames: Sequence[np.ndarray],
    x: float,
    y: float,
    radius: float,
    *,
    centre_reach: float = 0.03,
    radius_reach: float = 0.05,
) -> ContourFit:
    """Fit a sphere's contour near a circle.

    Args:
        frames: of `log_frames`, (H, W) each.
        x: column of the approximate centre.
        y: row of the approximate centre.
        radius: approximate, in pixels.
        centre_reach: distance of the centres searched, in radii, along x and y.
        radius_reach: distance of the radii searched, in radii.
    """
    margin = centre_reach + radius_reach + 2.5 * FINE_REACH_RATIO
    evidence = edge_evidence(
        frames, x, y, (1.0 - margin) * radius, (OUTSIDE_RATIOS[1] + centre_reach + radius_reach) * radius
    )
    step = COARSE_STEP_RATIO * radius
    radii = np.arange(1.0 - radius_reach, 1.0 + radius_reach + 1e-6, COARSE_STEP_RATIO) * radius
    profile = radius_profile(evidence, centre_reach * radius, radii, step)
    best = int(profile[:, 2].argmax())
    fit = _fine_fit(evidence, profile[best, 0], profile[best, 1], float(radii[best]))
    start = evidence.scores(np.zeros(1), radius * np.append(1.0, np.linspace(*OUTSIDE_RATIOS, 8))).ravel()
    return replace(fit, start_contrast=float(start[0] - start[1:].mean()))


def _fine_fit(evidence: EdgeEvidence, right: float, down: float, radius: float) -> ContourFit:
    """Return mean and covariance of the circles near one whose centre is offset by (right, down)."""
    step = FINE_STEP_RATIO * radius
    reach = FINE_REACH_RATIO * radius
    radii = radius + np.arange(-reach, reach + 1e-6, step)
    offsets = np.arange(-reach, reach + 1e-6, 2.0 * step)
    # Each ray is moved so that a contour offset by (right, down) lies on a circle around (x, y).
    moved = right * np.cos(evidence.angles) + down * np.sin(evidence.angles)
    shifted = replace(evidence, evidence=_shifted(evidence.evidence, moved / evidence.spacing))
    scores = shifted.scores(offsets, radii)
    best = float(scores.max())
    weight = np.exp((scores - best) / SCORE_DEVIATION)
    weight /= weight.sum()
    circles = np.stack(np.meshgrid(right + offsets, down + offsets, radii, indexing="ij"), axis=-1).reshape(-1, 3)
    mean = weight.ravel() @ circles
    covariance = (weight.ravel()[:, None] * (circles - mean)).T @ (circles - mean)
    covariance += np.eye(3) * (DEVIATION_FLOOR_RATIO * radius) ** 2
    outside = shifted.scores(np.zeros(1), float(mean[2]) * np.linspace(*OUTSIDE_RATIOS, 8))
    contrast = best - float(outside.mean())
    return ContourFit(float(evidence.x + mean[0]), float(evidence.y + mean[1]), float(mean[2]), covariance, contrast)


def _shifted(evidence: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the evidence (A, N) with each ray moved inward by its shift (A,), in samples."""
    bins = np.arange(evidence.shape[1])
    return np.stack([np.interp(bins + shift, bins, ray) for shift, ray in zip(shifts, evidence, strict=True)]).astype(
        np.float32
    )


@njit(cache=True, nogil=True)
def _circle_scores(
    evidence: np.ndarray, start: float, spacing: float, angles: np.ndarray, offsets: np.ndarray, radii: np.ndarray
) -> np.ndarray:
    """Return the mean evidence (I, J, K) along circles; to first order an offset moves the contour along each ray."""
    rays, count = evidence.shape
    scores = np.zeros((offsets.size, offsets.size, radii.size))
    for i in range(offsets.size):
        for j in range(offsets.size):
            for a in range(rays):
                offset = offsets[i] * np.cos(angles[a]) + offsets[j] * np.sin(angles[a]) - start
                for k in range(radii.size):
                    position = min(max((radii[k] + offset) / spacing, 0.0), count - 1.001)
                    n = int(position)
                    part = position - n
                    scores[i, j, k] += (1.0 - part) * evidence[a, n] + part * evidence[a, n + 1]
    return scores / rays
