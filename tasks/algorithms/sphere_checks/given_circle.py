"""A circle that a person gave, beside the one that the frames show near it: which of the two is to be used.

The contour of a sphere that mirrors the table it lies on may be hardly seen, while edges inside it, or around it and
its shadow, are clear. So contrast alone does not decide: by hand one errs by a few percent of the radius, and the
farther beyond that a fit lies, the clearer it must be.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.lighting.spheres import (
    MIN_CLEAR_CONTRAST,
    Sphere,
    is_radius_corrected,
    least_correction,
    measured_with_start,
)

MAX_START_RATIO = 0.9
"""Contrast of a given circle, relative to that of a fit at the same place, up to which the fit replaces it: an ellipse
has no better circle than the given one."""
MAX_INNER_START_RATIO, MAX_TOUCHING_REACH = 0.8, 1.03
"""The same for a fit inside the given circle, by how far it reaches in radii of that: edges inside the contour, such as
those of a mirrored object, may be stronger than its own."""
GIVEN_REACH_RATIO = 0.08
"""Distance from a given circle that is searched, in radii."""
HAND_REACH_RATIO, HAND_REACH_PX, HAND_POWER, LEAST_WEIGHT = 0.07, 1.5, 10.0, 0.15
"""Error of a circle drawn by hand, in radii and at least in pixels, beyond which a fit is hardly such a correction: its
contrast is weighted by exp(-d ** 10 / 2) at d times this distance, or by the least weight, as nothing at all may be
seen at the given circle (`python -m tests.benchmarks.spheres_given`)."""
RIVAL_DOUBT_POWER = 4.0
"""Power of the relative contrast by which a given circle that is replaced adds to the standard deviation: two circles
of nearly the same contrast leave it open which is the contour."""
UNKNOWN_DEVIATION_RATIO = 0.02
"""Standard deviation, in radii, of a given circle, by itself."""


@dataclass(frozen=True, slots=True)
class ConfirmedSphere:
    """A given sphere and what the frames show of it.

    sphere: what is to be used. fit: what was measured. is_clear: whether the contour is seen. is_corrected: whether the
    fit replaces the given circle. is_disputed: whether the given circle stands although the fit is clearer.
    given_contrast: contrast of the given circle relative to that of the fit, 0 where the contour is not seen.
    """

    sphere: Sphere
    fit: Sphere
    is_clear: bool
    is_corrected: bool
    is_disputed: bool = False
    given_contrast: float = 0.0


def confirm_sphere(
    frames: Sequence[np.ndarray] | np.ndarray, given: Sphere, *, camera: np.ndarray | None = None
) -> ConfirmedSphere:
    """Measure a given sphere; the fit replaces it where its contour is clear and lies elsewhere.

    Args: see `measure_sphere`.
    """
    fit, start_contrast = measured_with_start(frames, given, GIVEN_REACH_RATIO, GIVEN_REACH_RATIO, camera, refined=True)
    return judged(given, fit, start_contrast)


def judged(given: Sphere, fit: Sphere, contrast: float) -> ConfirmedSphere:
    """Return which of a given circle and a measured one is to be used, and how well it is known.

    Args:
        given: as the user states it.
        fit: its score is the contrast of its contour.
        contrast: of the given circle.
    """
    if fit.score < MIN_CLEAR_CONTRAST:
        deviation = UNKNOWN_DEVIATION_RATIO * given.radius
        unseen = replace(given, centre_sd=deviation, radius_sd=deviation)
        return ConfirmedSphere(unseen, fit, is_clear=False, is_corrected=False)
    distance, difference = given.distance(fit), abs(given.radius - fit.radius)
    given_contrast = contrast / fit.score
    is_inside = distance + fit.radius < MAX_TOUCHING_REACH * given.radius
    limit = MAX_INNER_START_RATIO if is_inside else MAX_START_RATIO
    is_apart = is_elsewhere(given, fit)
    if is_apart and given_contrast < limit * _hand_weight(given, fit):
        # The weaker the contour, and the stronger the given circle, the more that speaks against the fit.
        rival = max(given_contrast, 0.0) ** RIVAL_DOUBT_POWER
        doubt = max((MIN_CLEAR_CONTRAST / fit.score) ** 2, rival)
        deviations = (
            float(np.hypot(fit.centre_sd, doubt * distance)),
            float(np.hypot(fit.radius_sd, doubt * difference)),
        )
        used = replace(fit, centre_sd=deviations[0], radius_sd=deviations[1])
        return ConfirmedSphere(used, fit, is_clear=True, is_corrected=True, given_contrast=given_contrast)
    is_disputed = is_apart and given_contrast < limit
    return ConfirmedSphere(
        beside(given, fit),
        fit,
        is_clear=True,
        is_corrected=False,
        is_disputed=is_disputed,
        given_contrast=given_contrast,
    )


def beside(given: Sphere, fit: Sphere) -> Sphere:
    """Return a given circle that stands beside a measured one, with its standard deviations by the two."""
    own = UNKNOWN_DEVIATION_RATIO * given.radius
    centre_sd = _given_deviation(own, fit.centre_sd, given.distance(fit) / np.sqrt(2.0))
    radius_sd = _given_deviation(own, fit.radius_sd, abs(given.radius - fit.radius))
    return replace(given, centre_sd=centre_sd, radius_sd=radius_sd)


def is_elsewhere(given: Sphere, measured: Sphere) -> bool:
    """Return whether a measured circle differs from a given one by more than it is uncertain."""
    distance = given.distance(measured)
    return distance > least_correction(given.radius, measured.centre_sd) or is_radius_corrected(given.radius, measured)


def hand_reach(radius: float) -> float:
    """Return the error, in pixels, of circles of some radius that are drawn by hand."""
    return max(HAND_REACH_RATIO * radius, HAND_REACH_PX)


def _hand_weight(given: Sphere, fit: Sphere) -> float:
    """Return the weight of a fit's contrast by how far centre or radius lie from those of a given circle."""
    distance = max(given.distance(fit), abs(given.radius - fit.radius)) / hand_reach(given.radius)
    return max(float(np.exp(-0.5 * distance**HAND_POWER)), LEAST_WEIGHT)


def _given_deviation(given: float, fitted: float, difference: float) -> float:
    """Return the standard deviation of a given value beside a fitted one that differs, by those of the two.

    It is the RMS distance of the given value from what the two say together, in the units of the arguments.
    """
    share = given**2 / (given**2 + fitted**2)
    return float(np.hypot(np.sqrt(share) * fitted, share * difference))
