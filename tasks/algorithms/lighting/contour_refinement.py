"""The contour of a chrome sphere that is known to a few percent, in spite of shadows and mirrored objects.

Both move the strongest change along a ray away from the contour. The sphere's shadow lies beside it and is mirrored by
the rim: frames in which it crosses a ray are left out of that ray. The mirror image of an object beside the sphere ends
inside the contour, with a stronger edge than the contour's own; but the table outside brightens and dims as a whole,
while the mirror image has highlights of its own: deviations from the table's levels show where the table begins.
Without shadow a contour may have no contrast, and deviations need a mirrored object: neither is better on all spheres,
but the median of the fits is better than the first on almost all (`python -m tests.benchmarks.spheres_scenes`). The
centre is measured by the outer end of all edges too: inside the contour the rim has edges everywhere.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from glint.tasks.algorithms.lighting.circles import RAYS, EdgeEvidence, RaySamples, sample_rays
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
ARCS = 6
"""Arcs of the contour that are left out in turn."""
JACKKNIFE_FACTOR, SYSTEMATIC_RATIOS = 1.15, (0.002, 0.002, 0.004)
"""Factor of the jackknife's standard deviations, and those of x, y and radius, in radii, of what shifts all rays alike:
those by which the errors of 79 spheres, of simulated captures, scenes and another renderer's, are of the size stated
(`python -m tests.benchmarks.spheres_scenes`)."""


@dataclass(frozen=True, slots=True)
class _ContourEvidence:
    """Evidence by which a contour near a circle of `radius` about the samples' centre is fitted.

    levels: of changes of levels; variation: of how much they vary over time, by which the centre is corrected; None: it
    does not count.
    """

    radius: float
    levels: EdgeEvidence
    variation: EdgeEvidence | None = None

    def fit(self) -> ContourFit:
        """Fit the contour."""
        fit = fine_fit(self.levels, 0.0, 0.0, self.radius)
        return fit if self.variation is None else centred_by_variation(self.levels, self.variation, fit)

    def of_rays(self, used: np.ndarray) -> "_ContourEvidence":
        """Return the evidence of some of the rays (A,) bool."""
        variation = None if self.variation is None else self.variation.of_rays(used)
        return replace(self, levels=self.levels.of_rays(used), variation=variation)


def refine_contour(frames: Sequence[np.ndarray], fit: ContourFit) -> ContourFit:
    """Fit a contour without shadows and mirrored objects too, and return the median, with its uncertainty.

    The given fit is returned for a few stills, and where it is too small.

    Args:
        frames: of `log_frames`, (H, W) each.
        fit: of `fit_contour`.
    """
    if len(frames) < MIN_VARIATION_FRAMES or fit.radius < MIN_REFINED_RADIUS_PX:
        return fit
    evidence = [
        _whole(_samples(frames, fit), fit.radius),
        *(_refitted(frames, fit, measure) for measure in (_without_shadows, _without_shadows_and_objects)),
        *(_refitted(frames, fit, measure) for measure in (_outer_end, _outer_end_without_shadows)),
    ]
    circle = _median_circle([fit, *(part.fit() for part in evidence[1:])])
    x, y, radius = (float(value) for value in circle)

    def circle_of(used: np.ndarray) -> np.ndarray:
        return _median_circle([part.of_rays(used).fit() for part in evidence])

    covariance = arc_covariance(circle_of, RAYS, np.array(SYSTEMATIC_RATIOS) * radius)
    return replace(fit, x=x, y=y, radius=radius, covariance=covariance)


def _median_circle(fits: Sequence[ContourFit]) -> np.ndarray:
    """Return x, y and radius (3,) of fits; those of the outer end, the last two, count for the centre alone."""
    circles = np.array([[fit.x, fit.y, fit.radius] for fit in fits])
    return np.append(np.median(circles[:, :2], axis=0), np.median(circles[:-2, 2]))


def arc_covariance(circle_of: Callable[[np.ndarray], np.ndarray], rays: int, systematic: np.ndarray) -> np.ndarray:
    """Estimate the covariance (3, 3) of a circle's x, y and radius, without one arc of its rays after the other.

    What misleads a fit, a shadow or an edge inside the contour, does so over an arc, so that arcs are independent, but
    not rays: the jackknife over groups of rays (Quenouille 1956).

    Args:
        circle_of: the circle (3,) by some of the rays (A,) bool.
        rays: their number.
        systematic: (3,) standard deviations, in pixels, of what misleads all rays alike.
    """
    arc = np.arange(rays) * ARCS // rays
    circles = np.array([circle_of(arc != left) for left in range(ARCS)])
    offsets = circles - circles.mean(axis=0)
    return np.asarray(JACKKNIFE_FACTOR**2 * (ARCS - 1) / ARCS * offsets.T @ offsets + np.diag(np.square(systematic)))


def _samples(frames: Sequence[np.ndarray], fit: ContourFit) -> RaySamples:
    """Return the samples along rays beside a fit, cubic: linear interpolation blurs most between pixels, so that edges
    seem to lie nearer to them."""
    reach = (1.0 - INNER_REACH_RATIO) * fit.radius, OUTSIDE_RATIOS[1] * fit.radius
    return sample_rays(frames, fit.x, fit.y, *reach, interpolation=cv2.INTER_CUBIC)


def _refitted(
    frames: Sequence[np.ndarray], fit: ContourFit, measure: Callable[[RaySamples, float], _ContourEvidence]
) -> _ContourEvidence:
    """Return the evidence of samples around what was fitted to the evidence of samples around the fit."""
    around = fit
    for _ in range(REFITS - 1):
        around = measure(_samples(frames, around), around.radius).fit()
    return measure(_samples(frames, around), around.radius)


def _whole(samples: RaySamples, radius: float) -> _ContourEvidence:
    """Collect the evidence of all rays in all frames."""
    return _ContourEvidence(radius, level_evidence(samples), variation_evidence(samples))


def _without_shadows(samples: RaySamples, radius: float) -> _ContourEvidence:
    """Collect the evidence of the levels of rays that end on the table without a shadow."""
    return _ContourEvidence(radius, level_evidence(samples, _lit(samples, radius)))


def _outer_end(samples: RaySamples, radius: float) -> _ContourEvidence:
    """Collect the evidence of the outer end of all edges: what the rim mirrors has edges of its own, up to the contour,
    and beyond it they end on all sides at the same distance."""
    levels, variation = (measure(samples, of_outer_end=True) for measure in (level_evidence, variation_evidence))
    return _ContourEvidence(radius, levels, variation)


def _outer_end_without_shadows(samples: RaySamples, radius: float) -> _ContourEvidence:
    """Collect that evidence from the levels of rays that end on the table without a shadow."""
    return _ContourEvidence(radius, level_evidence(samples, _lit(samples, radius), of_outer_end=True))


def _without_shadows_and_objects(samples: RaySamples, radius: float) -> _ContourEvidence:
    """Collect the evidence of deviations from the table's levels where an object is mirrored, and elsewhere of levels
    without shadows and of the variation over time."""
    decreasing, weight = deviation_evidence(samples, radius)
    levels = _mixed(level_evidence(samples, _lit(samples, radius)), decreasing, weight)
    # What an object adds to the variation of the rim is not to be taken for the table's.
    return _ContourEvidence(radius, levels, _mixed(variation_evidence(samples), np.zeros_like(decreasing), weight))


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
