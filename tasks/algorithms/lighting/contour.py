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

from glint.tasks.algorithms.lighting.circles import OUTER_GAP_PX, EdgeEvidence, RaySamples, median_of, sample_rays

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
VARIATION_REACH_RATIO = 0.04
"""Distance of centres and radii, in radii, that is searched for the circle of the variation."""
MIN_VARIATION, MIN_VARIATION_CHANGE = 0.01, 0.001
"""Standard deviations of log levels, and changes of their logarithm, below which there is only noise."""
AGREEING_RATIO, MAX_VARIATION_DISTANCE_RATIO, MIN_CLEARNESS_RATIO = 0.01, 0.025, 2.0
"""Distance of centres, in radii, up to which the circle of the variation counts beside that of the levels; the same
where it is the clearer one, and the ratio of contrasts from which it is. What varies may also end where an object or
its caustics are mirrored."""
OUTER_WEIGHT, END_OUTER_WEIGHT, END_OUTER_GAP_PX = 0.25, 0.5, 2.0
"""Weight of the evidence outside an edge, at OUTER_GAP_PX, that counts against it; the same, and its distance, where
the outer end of all edges is sought."""
INWARD_SHIFT_PX = 0.15
"""Distance by which the strongest change lies inside the contour: the rim mirrors the table's edge of the contour."""
SCORE_DEVIATION = 0.01
"""Difference of mean evidence that divides the posterior by e; chosen so that deviations match the errors
(`python -m tests.benchmarks.spheres_scenes`)."""
COARSE_STEP_RATIO, FINE_STEP_RATIO = 0.01, 0.0025
"""Steps of the grids of circles, in radii."""
FINE_REACH_RATIO, FINE_MARGINS = 0.035, 2.5
"""Distance from the best coarse circle that the fine grid covers, in radii, and the reach of samples farther inside, in
such distances: centre and radius each vary by one."""
OUTSIDE_RATIOS, OUTSIDE_CIRCLES = (1.08, 1.25), 8
"""Radii, relative to a circle's, between which there is no rounder edge if the circle is a contour, and the circles
there with whose mean evidence its own is compared."""
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


def level_evidence(samples: RaySamples, used: np.ndarray | None = None, *, of_outer_end: bool = False) -> EdgeEvidence:
    """Measure the evidence, 0..1 before what lies outside counts against it, of changes of log levels along rays.

    Args:
        samples: of all frames.
        used: (T, A) bool, the rays of each frame that count; at least one frame of each ray.
        of_outer_end: seek the outer end of all edges, which lies a little outside the contour, by the same everywhere.
    """
    counts = np.ones(samples.levels.shape[:2], np.float32) if used is None else used.astype(np.float32)
    single, mean = np.zeros((2, *samples.valid.shape), np.float32)
    for frame, count in zip(samples.levels, counts[:, :, None], strict=True) if samples.valid.any() else ():
        change = change_along_rays(frame, samples.reach) / (2 * samples.reach * samples.spacing)
        usual = median_of(np.abs(change[samples.valid][::3])) + MIN_CHANGE
        square = np.minimum((change / usual) ** 2, 1e3)
        single += count * square / (square + HALF_FRAME_RATIO)
        mean += count * square
    total = counts.sum(axis=0)[:, None]
    single, mean = single / total, mean / total
    evidence = (1.0 - MEAN_WEIGHT) * single + MEAN_WEIGHT * mean / (mean + HALF_MEAN_RATIO)
    return _net_evidence(samples, evidence, of_outer_end)


def variation_evidence(samples: RaySamples, *, of_outer_end: bool = False) -> EdgeEvidence:
    """Measure the evidence, likewise, of increases outward along the rays of how much log levels vary over time.

    The table varies with the light and with shadows; what the rim mirrors of it varies less, since haze and reflections
    of the room lie over it. Neighbouring rays are averaged: the table's texture does not vary by itself.
    """
    rays = max(1, 2 * round(VARIATION_ARC_DEG * samples.valid.shape[0] / 720.0) + 1)
    variation = np.log(samples.levels.std(axis=0) + MIN_VARIATION)
    change = change_along_rays(averaged_over_rays(variation, rays), samples.reach)
    return increase_evidence(samples, change, MIN_VARIATION_CHANGE, HALF_VARIATION_RATIO, of_outer_end=of_outer_end)


def averaged_over_rays(values: np.ndarray, rays: int) -> np.ndarray:
    """Return values (A, N) float32 averaged over an odd number of neighbouring rays."""
    half = rays // 2
    around = np.pad(values, ((half, half), (0, 0)), mode="wrap")
    return np.asarray(cv2.blur(around, (1, rays)))[half : half + len(values)]


def increase_evidence(
    samples: RaySamples, change: np.ndarray, least: float, half_ratio: float, *, of_outer_end: bool = False
) -> EdgeEvidence:
    """Measure the evidence of increases among changes (A, N) outward along the rays.

    least: change below which there is only noise; half_ratio: squared increase, relative to the usual change, whose
    evidence is one half; of_outer_end: see `level_evidence`.
    """
    valid = samples.valid
    if not valid.any():
        return _net_evidence(samples, np.zeros(valid.shape, np.float32), of_outer_end)
    usual = float(np.median(np.abs(change[valid]))) + least
    square = (np.maximum(change, 0.0) / usual) ** 2
    return _net_evidence(samples, square / (square + half_ratio), of_outer_end)


def _net_evidence(samples: RaySamples, evidence: np.ndarray, of_outer_end: bool) -> EdgeEvidence:
    """Return evidence (A, N) with what lies outside the frame left out, and what lies outside an edge subtracted."""
    evidence = np.where(samples.valid, evidence, np.float32(0.0))
    weight, distance = (END_OUTER_WEIGHT, END_OUTER_GAP_PX) if of_outer_end else (OUTER_WEIGHT, OUTER_GAP_PX)
    gap = max(1, round(distance / samples.spacing))
    evidence[:, :-gap] -= weight * evidence[:, gap:]
    return EdgeEvidence(samples.x, samples.y, evidence, samples.start, samples.spacing, samples.angles)


def change_along_rays(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the differences of values (A, N) between `reach` samples farther out and farther in; 0 at the ends."""
    change = np.zeros_like(values)
    change[:, reach:-reach] = values[:, 2 * reach :] - values[:, : -2 * reach]
    return change


def radius_profile(evidence: EdgeEvidence, reach: float, radii: np.ndarray, step: float) -> np.ndarray:
    """Return for each radius (K,) the best circle's (offset x, offset y, score), (K, 3), among nearby centres."""
    offsets = np.arange(-reach, reach + 0.001 * step, step)
    scores = evidence.scores(offsets, radii - INWARD_SHIFT_PX).reshape(-1, len(radii))
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
    margin = centre_reach + radius_reach + FINE_MARGINS * FINE_REACH_RATIO
    reach = (1.0 - margin) * radius, (OUTSIDE_RATIOS[1] + centre_reach + radius_reach) * radius
    samples = sample_rays(frames, x, y, *reach)
    evidence = level_evidence(samples)
    fit = _best_fit(evidence, (x, y, radius), centre_reach, radius_reach)
    if len(frames) >= MIN_VARIATION_FRAMES:
        fit = centred_by_variation(evidence, variation_evidence(samples), fit)
    own, *outside = evidence.scores(np.zeros(1), np.append(radius, _outside(radius)) - INWARD_SHIFT_PX).ravel()
    return replace(fit, start_contrast=float(own - np.mean(outside)))


def _outside(radius: float) -> np.ndarray:
    """Return the radii (OUTSIDE_CIRCLES,) of circles outside one of a radius."""
    return radius * np.linspace(*OUTSIDE_RATIOS, OUTSIDE_CIRCLES)


def centred_by_variation(levels: EdgeEvidence, variation: EdgeEvidence, fit: ContourFit) -> ContourFit:
    """Return the fit to the evidence of levels and of variation together; the given fit where they disagree.

    Blur and haze move the variation's edge inward or outward, so it is moved to the radius of the levels' edge first:
    it measures the centre alone.
    """
    varying = _best_fit(variation, (fit.x, fit.y, fit.radius), VARIATION_REACH_RATIO, VARIATION_REACH_RATIO)
    distance, outward = float(np.hypot(varying.x - fit.x, varying.y - fit.y)), varying.radius - fit.radius
    is_clearer = varying.contrast > MIN_CLEARNESS_RATIO * fit.contrast
    if distance > (MAX_VARIATION_DISTANCE_RATIO if is_clearer else AGREEING_RATIO) * fit.radius:
        return fit
    aligned = variation.moved(0.0, 0.0, outward).evidence
    together = replace(
        levels, evidence=(1.0 - VARIATION_WEIGHT) * levels.evidence + np.float32(VARIATION_WEIGHT) * aligned
    )
    middle = 0.5 * (fit.x + varying.x) - levels.x, 0.5 * (fit.y + varying.y) - levels.y
    combined = fine_fit(together, *middle, fit.radius)
    half = 0.5 * np.array([varying.x - fit.x, varying.y - fit.y, 0.0])  # Systematic: either may be the wrong one.
    return replace(combined, covariance=combined.covariance + np.outer(half, half), contrast=fit.contrast)


def _best_fit(
    evidence: EdgeEvidence, circle: tuple[float, float, float], centre_reach: float, radius_reach: float
) -> ContourFit:
    """Return the fit of the best circle near a circle (x, y, radius), within reaches in its radii."""
    right, down, radius = circle[0] - evidence.x, circle[1] - evidence.y, circle[2]
    radii = np.arange(1.0 - radius_reach, 1.0 + radius_reach + 1e-6, COARSE_STEP_RATIO) * radius
    profile = radius_profile(evidence.moved(right, down), centre_reach * radius, radii, COARSE_STEP_RATIO * radius)
    best = int(profile[:, 2].argmax())
    return fine_fit(evidence, right + profile[best, 0], down + profile[best, 1], float(radii[best]))


def fine_fit(evidence: EdgeEvidence, right: float, down: float, radius: float) -> ContourFit:
    """Return mean and covariance of the circles near one whose centre is offset by (right, down)."""
    step = FINE_STEP_RATIO * radius
    reach = FINE_REACH_RATIO * radius
    radii = radius + np.arange(-reach, reach + 0.001 * step, step)
    offsets = np.arange(-reach, reach + 0.001 * step, 2.0 * step)
    shifted = evidence.moved(right, down)
    scores = shifted.scores(offsets, radii - INWARD_SHIFT_PX)
    best = float(scores.max())
    weight = np.exp((scores - best) / SCORE_DEVIATION)
    weight /= weight.sum()
    circles = np.stack(np.meshgrid(right + offsets, down + offsets, radii, indexing="ij"), axis=-1).reshape(-1, 3)
    mean = weight.ravel() @ circles
    covariance = (weight.ravel()[:, None] * (circles - mean)).T @ (circles - mean)
    covariance += np.eye(3) * (DEVIATION_FLOOR_RATIO * radius) ** 2
    outside = shifted.scores(np.zeros(1), _outside(float(mean[2])) - INWARD_SHIFT_PX)
    contrast = best - float(outside.mean())
    return ContourFit(float(evidence.x + mean[0]), float(evidence.y + mean[1]), float(mean[2]), covariance, contrast)
