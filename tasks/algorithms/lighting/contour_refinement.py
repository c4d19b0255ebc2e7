"""The contour of a chrome sphere that is known to a few percent, in spite of shadows and mirrored objects.

Both move the strongest change along a ray away from the contour. The sphere's shadow lies beside it and is mirrored by
the rim: frames in which it crosses a ray are left out of that ray. The mirror image of an object beside the sphere ends
inside the contour, with a stronger edge than the contour's own; but the table outside brightens and dims as a whole,
while the mirror image has highlights of its own: deviations from the table's levels show where the table begins.
Without shadow a contour may have no contrast, and deviations need a mirrored object: neither is better on all spheres,
but the median of the three fits is better than the first on almost all (`python -m tests.benchmarks.spheres_scenes`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.lighting.circles import EdgeEvidence, RaySamples, sample_rays
from glint.tasks.algorithms.lighting.contour import (
    MIN_VARIATION_FRAMES,
    OUTSIDE_RATIOS,
    ContourFit,
    averaged_over_rays,
    centred_by_variation,
    change_along_rays,
    fine_fit,
    increase_evidence,
    level_evidence,
    variation_evidence,
)

INNER_REACH_RATIO = 0.1
"""Reach of the samples inside the contour, in radii."""
TABLE_GAP_PX, TABLE_REACH_PX, TABLE_REACH_RATIO = 2.0, 6.0, 0.12
"""Distance from the contour at which the table beside it begins, and ends: the larger of so many pixels and radii."""
RIM_GAP_PX, RIM_REACH_PX, RIM_REACH_RATIO = 1.5, 4.0, 0.06
"""The same inside the contour, for the mirror image at the rim."""
SHADOW_DEPTH = 0.5
"""Log levels by which the table beside a ray is darker than it is usually, relative to the other rays, in a shadow."""
USUAL_TIME_PERCENTILE, USUAL_RAY_PERCENTILE = 65.0, 75.0
"""Percentiles of the levels over frames, and of the rays of a frame, that no shadow reaches."""
MIN_UNSHADED_FRAMES = 4
"""Frames without shadow below which a ray keeps them all."""
SERIES_RAYS = 7
"""Neighbouring rays over which the table's levels, and the deviations from them, are averaged."""
MAX_DEVIATION = 0.6
"""Deviation from the table's log levels that counts at most: a highlight says no more than another mirror image."""
MIN_DEVIATION = 0.01
"""Deviation of log levels below which there is only noise."""
MIRRORING_RATIO = 3.0
"""Deviation at the rim, relative to that on the table, from which a ray is judged by the deviations, wholly so at one
more."""
HALF_DEVIATION_RATIO = 4.0
"""Squared decrease of the deviation outward, relative to the usual one, whose evidence is one half."""
MIN_REFINED_RADIUS_PX = 3.0
"""Radius from which a contour has pixels enough inside, beside its rim, to be compared with the table's."""
REFITS = 2
"""Fits, each sampled from the centre of the one before."""


def refine_contour(frames: Sequence[np.ndarray], fit: ContourFit) -> ContourFit:
    """Fit a contour without shadows and mirrored objects too, and return the median.

    The given fit is returned for a few stills, and where it is too small.

    Args:
        frames: of `log_frames`, (H, W) each.
        fit: of `fit_contour`.
    """
    if len(frames) < MIN_VARIATION_FRAMES or fit.radius < MIN_REFINED_RADIUS_PX:
        return fit
    fits = [fit, _refitted(frames, fit, _without_shadows), _refitted(frames, fit, _without_shadows_and_objects)]
    circles = np.array([[circle.x, circle.y, circle.radius] for circle in fits])
    middle = np.median(circles, axis=0)
    spread = np.mean((circles - middle) ** 2, axis=0)
    covariance = np.mean([circle.covariance for circle in fits], axis=0) + np.diag(spread)
    x, y, radius = (float(value) for value in middle)
    return replace(fit, x=x, y=y, radius=radius, covariance=covariance)


def _refitted(
    frames: Sequence[np.ndarray], fit: ContourFit, measure: Callable[[RaySamples, float], ContourFit]
) -> ContourFit:
    """Measure the contour by samples around the fit, and again around what was measured."""
    for _ in range(REFITS):
        reach = (1.0 - INNER_REACH_RATIO) * fit.radius, OUTSIDE_RATIOS[1] * fit.radius
        fit = measure(sample_rays(frames, fit.x, fit.y, *reach), fit.radius)
    return fit


def _without_shadows(samples: RaySamples, radius: float) -> ContourFit:
    """Fit the contour to the levels of rays that end on the table without a shadow."""
    return fine_fit(level_evidence(samples, _lit(samples, radius)), 0.0, 0.0, radius)


def _without_shadows_and_objects(samples: RaySamples, radius: float) -> ContourFit:
    """Fit the contour by deviations from the table's levels where an object is mirrored, and elsewhere by levels
    without shadows and by the variation over time."""
    decreasing, weight = deviation_evidence(samples, radius)
    evidence = _mixed(level_evidence(samples, _lit(samples, radius)), decreasing, weight)
    # What an object adds to the variation of the rim is not to be taken for the table's.
    variation = _mixed(variation_evidence(samples), np.zeros_like(decreasing), weight)
    return centred_by_variation(evidence, variation, fine_fit(evidence, 0.0, 0.0, radius))


def _mixed(evidence: EdgeEvidence, replacement: np.ndarray, weight: np.ndarray) -> EdgeEvidence:
    """Return evidence (A, N) replaced in each ray by a share of weight (A,)."""
    share = weight[:, None]
    return replace(evidence, evidence=((1.0 - share) * evidence.evidence + share * replacement).astype(np.float32))


def _lit(samples: RaySamples, radius: float) -> np.ndarray:
    """Return for each frame which rays (T, A) end on the table without a shadow."""
    table = samples.levels[:, :, _table(samples, radius)].mean(axis=2)
    table = table - np.percentile(table, USUAL_TIME_PERCENTILE, axis=0)
    table -= np.percentile(table, USUAL_RAY_PERCENTILE, axis=1)[:, None]
    lit = table > -SHADOW_DEPTH
    return np.asarray(lit | (lit.sum(axis=0) < MIN_UNSHADED_FRAMES))


def deviation_evidence(samples: RaySamples, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence (A, N) that deviations from the table's levels decrease outward, and its weight (A,), 0..1:
    it is 1 for rays whose rim mirrors an object."""
    outside = _table(samples, radius)
    distance = radius - samples.radii
    inside = (distance > RIM_GAP_PX) & (distance < max(RIM_REACH_PX, RIM_REACH_RATIO * radius))
    levels = samples.levels
    table = np.median(levels[:, :, outside] - np.median(levels[:, :, outside], axis=0), axis=2)
    deviations = levels - averaged_over_rays(table.T, SERIES_RAYS).T[:, :, None]
    deviations -= np.median(deviations, axis=0)
    deviation = averaged_over_rays(np.sqrt(np.minimum(deviations**2, MAX_DEVIATION**2).mean(axis=0)), SERIES_RAYS)
    rim = deviation[:, inside].mean(axis=1)
    ratio = rim / (deviation[:, outside].mean(axis=1) + MIN_DEVIATION)
    decrease = -change_along_rays(deviation, samples.reach) / (rim + MIN_DEVIATION)[:, None]
    evidence = increase_evidence(samples, decrease, MIN_DEVIATION, HALF_DEVIATION_RATIO).evidence
    return evidence, np.clip(ratio - MIRRORING_RATIO, 0.0, 1.0)


def _table(samples: RaySamples, radius: float) -> np.ndarray:
    """Return which samples (N,) of a ray lie on the table beside the contour."""
    distance = samples.radii - radius
    return (distance > TABLE_GAP_PX) & (distance < max(TABLE_REACH_PX, TABLE_REACH_RATIO * radius))
