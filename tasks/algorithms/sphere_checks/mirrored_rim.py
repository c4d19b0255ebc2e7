"""The contour of a chrome sphere by its rim, the mirror image of the table beside it.

Inside its contour a sphere shows, strongly compressed, what lies outside it. Where the rim is as bright as the table,
the contour has no edge of its own, while the compressed image has many, so that the clearest circle lies a few percent
inside. There the circle is taken whose inside is the mirror image of its outside (`rim_evidence`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from glint.tasks.algorithms.lighting.circles import EdgeEvidence
from glint.tasks.algorithms.lighting.contour import ContourFit, fine_fit, radius_profile
from glint.tasks.algorithms.lighting.contour_refinement import arc_covariance
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.spheres import Sphere, SphereCrop
from glint.tasks.algorithms.sphere_checks.rim_evidence import (
    CENTRE_REACH_RATIO,
    RADIUS_REACH_RATIO,
    RIM_RAYS,
    RIM_SHIFT_PX,
    TABLE_RATIO,
    RimModel,
    RimSamples,
    circle_score,
)

RIM_FRAMES, MODEL_FRAMES = 48, 12
"""Frames by which the rim is fitted, and those among them by which its model is chosen."""
RIM_RADIUS_PX = 40.0
"""Radius to which the image of a larger sphere is reduced, up to twice as much."""
TABLE_TILTS_DEG, BLURS_PX, LEVEL_STEPS = (0.0, 20.0, 40.0, 55.0), (0.6, 1.2, 2.0), (-0.03, -0.1, -0.2, -0.35)
"""Angles of the table's normal, blurs and steps of the models, of whose combinations the best is taken."""
LEAST_STEP = LEVEL_STEPS[0]
"""Step up to which a contour has no edge of its own."""
STEP_RATIO = 0.015
"""Coarsest step of the circles that are searched, in radii."""
RIM_SYSTEMATIC_RATIOS = 0.006, 0.006, 0.01
"""Standard deviations of x, y and radius, in radii, of what misleads all rays alike: the radius is 1% too large of a
sphere that does not lie on the table."""
CLEAR_SCORE, MIN_RIM_RADIUS_PX = 0.45, 10.0
"""Score of a sphere from which its contour is clear by itself, and the radius of the smallest whose rim has pixels."""
RIM_ROUNDS, SETTLED_RATIO = 4, 0.03
"""Most fits, each about the circle of the one before, and the distance, in radii, within which they have settled."""
OUTER_RATIOS = 1.15, 1.3, 1.45
"""Radii of the circles around a found one that are tried, in its radii."""
MIN_GAIN, MAX_DEVIATION_RATIO = 0.005, 0.012
"""Gain from which a fit counts as better than the circle it began with, and the largest standard deviation, in radii,
of one that is used (`python -m tests.benchmarks.spheres_found`)."""


@dataclass(frozen=True, slots=True)
class RimFit:
    """Contour by its rim.

    sphere: with its deviations. model: of the rim. gain: in the score over the circle that the fit began with.
    is_inside: whether it lies within the reach of the search, rather than at its end.
    """

    sphere: Sphere
    model: RimModel
    gain: float
    is_inside: bool


def with_mirrored_rim(frames: np.ndarray, sphere: Sphere, camera: np.ndarray | None = None) -> Sphere:
    """Return a found sphere by its rim where that decides, else as it is.

    If nothing is decided beside the circle, larger ones around it are tried, since it may be the mirror image of the
    horizon. frames, sphere, camera: see `settled_rim`.
    """
    fit = settled_rim(frames, sphere, camera)
    if fit is not None:
        return fit.sphere if fit.gain > MIN_GAIN else sphere
    for ratio in OUTER_RATIOS:
        # The table's horizon is seen farther up on the sphere than its centre.
        outer = replace(sphere, y=sphere.y + (ratio - 1.0) * sphere.radius, radius=ratio * sphere.radius)
        if outer.is_inside(frames.shape[2], frames.shape[1]):
            fit = settled_rim(frames, outer, camera, RADIUS_REACH_RATIO)
            if fit is not None:
                return fit.sphere
    return sphere


def settled_rim(
    frames: np.ndarray, sphere: Sphere, camera: np.ndarray | None = None, shrinkage: float = SETTLED_RATIO
) -> RimFit | None:
    """Fit a sphere's contour by its rim, each fit about the one before; None where the rim does not decide.

    It decides where the contour is not clear and has no edge of its own, and the rim shows well where it is.

    Args:
        frames: (T, H, W) in levels of 8 bits, under different lights.
        sphere: in the frames' pixels; its score is that of its contour.
        camera: perspective camera's matrix (3, 3), before which no rim decides.
        shrinkage: most by which the contour may lie inside the circle, in radii: what is clearer than the contour lies
            inside it, so that one far inside a clear circle is none.
    """
    if camera is not None or sphere.score >= CLEAR_SCORE or sphere.radius < MIN_RIM_RADIUS_PX:
        return None
    start, gain = sphere, 0.0
    for _ in range(RIM_ROUNDS):
        fit = fit_mirrored_rim(frames, start)
        if fit.model.step != LEAST_STEP or fit.sphere.radius < (1.0 - shrinkage) * sphere.radius:
            return None
        gain += fit.gain
        if max(fit.sphere.distance(start), abs(fit.sphere.radius - start.radius)) < SETTLED_RATIO * start.radius:
            deviation = max(fit.sphere.centre_sd, fit.sphere.radius_sd)
            is_known = fit.is_inside and deviation < MAX_DEVIATION_RATIO * fit.sphere.radius
            return replace(fit, gain=gain) if is_known else None
        if fit.gain < MIN_GAIN:
            return None
        start = fit.sphere
    return None


def fit_mirrored_rim(frames: np.ndarray, sphere: Sphere) -> RimFit:
    """Fit the contour of a sphere, near a circle, by what its rim mirrors.

    frames, sphere: see `settled_rim`.
    """
    crop = SphereCrop.around(spread(frames, RIM_FRAMES), sphere, TABLE_RATIO + CENTRE_REACH_RATIO, RIM_RADIUS_PX)
    x, y, radius = crop.from_full_frame(sphere)
    samples = RimSamples.take(crop.frames, x, y, radius)
    model = max(_models(), key=lambda model: _coarse_fit(samples.evidence(model, MODEL_FRAMES), radius)[3])
    # The mirror image is computed for a sphere about the samples' centre, which the first fit finds.
    right, down, _, _ = _coarse_fit(samples.evidence(model), radius)
    evidence = RimSamples.take(crop.frames, x + right, y + down, radius).evidence(model)
    fit = _fit(evidence, radius)
    gain = circle_score(evidence, fit.x, fit.y, fit.radius) - circle_score(evidence, x, y, radius - RIM_SHIFT_PX)

    def circle_of(used: np.ndarray) -> np.ndarray:
        part = _fit(evidence.of_rays(used), radius)
        return np.array([part.x, part.y, part.radius])

    covariance = arc_covariance(circle_of, RIM_RAYS, np.array(RIM_SYSTEMATIC_RATIOS) * radius)
    shifted = replace(fit, radius=fit.radius + RIM_SHIFT_PX, covariance=covariance)
    is_inside = abs(fit.radius - radius) < (RADIUS_REACH_RATIO - STEP_RATIO) * radius
    return RimFit(crop.to_full_frame(shifted, sphere.score), model, gain, is_inside)


def _models() -> Iterator[RimModel]:
    """Yield the models that are tried."""
    for tilt, blur, step in product(TABLE_TILTS_DEG, BLURS_PX, LEVEL_STEPS):
        yield RimModel(float(np.radians(tilt)), blur, step)


def _coarse_fit(evidence: EdgeEvidence, radius: float) -> tuple[float, float, float, float]:
    """Return the best circle near one about the evidence's centre: right, down, radius and its score."""
    radii = radius * np.arange(1.0 - RADIUS_REACH_RATIO, 1.001 + RADIUS_REACH_RATIO, 0.5 * STEP_RATIO)
    profile = radius_profile(evidence, CENTRE_REACH_RATIO * radius, radii, STEP_RATIO * radius)
    best = int(profile[:, 2].argmax())
    right, down, score = (float(value) for value in profile[best])
    return right, down, float(radii[best]), score


def _fit(evidence: EdgeEvidence, radius: float) -> ContourFit:
    """Return the fit of the best circle near one about the evidence's centre."""
    right, down, best, _ = _coarse_fit(evidence, radius)
    return fine_fit(evidence, right, down, best)
