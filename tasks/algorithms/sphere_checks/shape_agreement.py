"""How a circle agrees with the shapes of the highlights on its sphere: what contradicts it, and the mean of both."""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import ShapeCircle

MIN_CONTRADICTION_RATIO, MIN_CONTRADICTION_DEVIATIONS = 0.03, 3.0
"""Distance of a circle's centre from that of the highlights, in radii and in standard deviations, from which the two
contradict each other (`python -m tests.benchmarks.spheres_found`)."""
USUAL_DEVIATIONS = 1.7
"""Distance of the two centres, in standard deviations, up to which they agree: that of three in four Gaussian ones."""
SYSTEMATIC_RATIO = 0.01
"""Standard deviation of what the highlights say, in radii, of what shifts all shapes alike."""
MAX_EXCESS_RATIO = 0.05
"""Difference from the largest radius that the highlights allow, in radii, from which a circle is too large, if it is
three standard deviations too."""


def contradicts(shapes: ShapeCircle, sphere: Sphere, deviations: float = MIN_CONTRADICTION_DEVIATIONS) -> bool:
    """Return whether the shapes of highlights contradict a circle: its centre, or that it is so large.

    deviations: standard deviations from which they do.
    """
    centre_sd, systematic = centre_deviation(sphere, shapes), SYSTEMATIC_RATIO * sphere.radius
    radius_sd = np.sqrt(sphere.radius_sd**2 + (shapes.log_radius_sd * shapes.max_radius) ** 2 + systematic**2)
    return bool(
        distance(sphere, shapes) > max(MIN_CONTRADICTION_RATIO * sphere.radius, deviations * centre_sd)
        or sphere.radius - shapes.max_radius > max(MAX_EXCESS_RATIO * sphere.radius, deviations * radius_sd)
    )


def beside_highlights(circle: Sphere, shapes: ShapeCircle, radius_sd: float) -> Sphere:
    """Return a circle that the highlights allow, with the deviation that their shapes leave its centre."""
    difference = distance(circle, shapes) / float(np.sqrt(2.0))
    centre_sd = max(shapes.sd, difference, SYSTEMATIC_RATIO * circle.radius)
    return replace(circle, centre_sd=centre_sd, radius_sd=radius_sd)


def with_highlights(circle: Sphere, shapes: ShapeCircle) -> Sphere:
    """Return a circle whose centre is the mean of its own and the highlights', by their precision.

    It is known worse in proportion where the two differ more than their deviations let expect.
    """
    systematic = SYSTEMATIC_RATIO * circle.radius
    own = circle.centre_sd**2 + systematic**2
    other = shapes.sd**2 + systematic**2
    share = other / (own + other)
    return replace(
        circle,
        x=share * circle.x + (1.0 - share) * shapes.x,
        y=share * circle.y + (1.0 - share) * shapes.y,
        centre_sd=float(np.sqrt(share * own)) * birge_ratio(circle, shapes),
    )


def birge_ratio(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return the factor, at least 1, by which two measurements of the centre differ more than their deviations let
    expect (Birge 1932)."""
    return max(distance(circle, shapes) / (USUAL_DEVIATIONS * centre_deviation(circle, shapes)), 1.0)


def centre_deviation(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return the standard deviation per axis, in pixels, of the difference of the two centres."""
    return float(np.sqrt(circle.centre_sd**2 + shapes.sd**2 + (SYSTEMATIC_RATIO * circle.radius) ** 2))


def distance(sphere: Sphere, shapes: ShapeCircle) -> float:
    """Return the distance of a circle's centre from that of the highlights in pixels."""
    return float(np.hypot(sphere.x - shapes.x, sphere.y - shapes.y))
