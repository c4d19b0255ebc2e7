"""The circle that agrees best with the shapes of the highlights, where those doubt another one.

About the centre that they show, and below the radius that they allow, the contour is sought again: the circle with the
most contrast, weighted by its distance from their centre.
"""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.lighting.spheres import MIN_CLEAR_CONTRAST, Sphere, measure_sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import ShapeCircle
from glint.tasks.algorithms.sphere_checks.shape_agreement import (
    centre_deviation,
    contradicts,
    distance,
    with_highlights,
)

MAX_SEARCH_SD_RATIO, MAX_SEARCH_LOG_RADIUS_SD = 0.04, 0.06
"""Standard deviation of the highlights' centre, in radii, and of the logarithm of their radius, beyond which no other
circle is sought."""
MIN_RIVAL_GAIN, MIN_RIVAL_CONTRAST = 1.25, 0.8
"""Agreement with the highlights, and contrast, relative to those of a circle that they do not contradict, from which
another one takes its place. Where that was right on 130 found circles, the agreement was 1.4 to 3.1 times as high, else
up to 1.1 times, or with two thirds of the contrast."""
SEARCH_LOG_RATIOS = -0.6, 0.25
"""Logarithms of the largest radius, relative to the circle's, between which one is sought: blur adds to it."""
RIVAL_RADIUS_RATIOS = (0.74, 0.78, 0.82, 0.86, 0.9, 0.94, 0.98, 1.02)
"""Radii that are measured about the highlights' centre, relative to the largest that they allow: without blur it is 2
to 7% above the true one, with small lights in shaken frames 30%."""
LEAST_USUAL_RATIO, USUAL_RATIO = 0.86, 0.94
"""Radius relative to the largest one below which a circle is smaller than blur explains, and the usual one: what it
lacks is doubt, as it may be an edge inside the sphere."""
HORIZON_RATIOS = 0.66, 0.79
"""Ratios of two radii between which the inner circle may be the mirror image of the horizon, seen from above: where the
normal is 45 degrees from the line of sight, at 0.71 of the radius. The outer one is the contour then."""
SAME_RADIUS_RATIO, RIVAL_SHARE = 0.06, 0.7
"""Difference of two radii, relative to one, from which they are two circles, and share of the best one's agreement from
which the other leaves the radius in doubt."""
RIVAL_CENTRE_REACH, RIVAL_RADIUS_REACH = 0.015, 0.03
"""Distances that each of them searches, in radii, beside those of the fine fit."""
CENTRE_PENALTY_DEVIATIONS = 2.0
"""Distance from the highlights' centre, in standard deviations, by which contrasts are weighted (as a Gaussian)."""


def rival_circle(
    frames: np.ndarray, sphere: Sphere, shapes: ShapeCircle, camera: np.ndarray | None, *, is_contradicted: bool
) -> Sphere | None:
    """Return the circle with the most contrast about the highlights' centre, whose centre is the mean of its own and
    theirs; None: none is clear and agrees.

    Its score is its contrast. Where the highlights do not contradict the circle, it must agree much better than that
    one, and not be the horizon's mirror image inside it.

    Args:
        frames: (T, H, W) uint8, spread over the capture.
        sphere: the circle, in the frames' pixels.
        shapes: what the highlights say of it.
        camera: perspective camera's matrix (3, 3).
        is_contradicted: whether the highlights contradict the circle.
    """
    is_vague = shapes.sd > MAX_SEARCH_SD_RATIO * sphere.radius or shapes.log_radius_sd > MAX_SEARCH_LOG_RADIUS_SD
    log_ratio = float(np.log(shapes.max_radius / sphere.radius))
    if is_vague or not SEARCH_LOG_RATIOS[0] < log_ratio < SEARCH_LOG_RATIOS[1]:
        return None
    middle = replace(sphere, x=shapes.x, y=shapes.y)
    starts = [replace(middle, radius=ratio * shapes.max_radius) for ratio in RIVAL_RADIUS_RATIOS]
    clear = [
        circle
        for circle in (_measured(frames, start, camera) for start in starts)
        if circle.score >= MIN_CLEAR_CONTRAST and not contradicts(shapes, circle)
    ]
    if not clear:
        return None
    rival = _strongest(clear, shapes)
    outer = [circle for circle in clear if _is_horizon(rival, circle)]
    if outer:
        rival = _strongest(outer, shapes)
    radius_doubt = _radius_doubt(rival, clear, shapes)
    if not is_contradicted:
        own = _measured(frames, sphere, camera)
        is_clear = rival.score >= MIN_RIVAL_CONTRAST * own.score and not _is_horizon(rival, own)
        if not is_clear or _agreement(rival, shapes) < MIN_RIVAL_GAIN * _agreement(own, shapes):
            return None
        if _is_same(rival, own):
            # Nothing has doubted the radius of the circle but this one.
            radius_doubt = abs(rival.radius - own.radius) / 2.0
    return replace(with_highlights(rival, shapes), radius_sd=float(np.hypot(rival.radius_sd, radius_doubt)))


def _measured(frames: np.ndarray, start: Sphere, camera: np.ndarray | None) -> Sphere:
    """Return the clearest circle near one; its score is its contrast.

    Refined fits search farther, and would find the edge again that misled the first one.
    """
    return measure_sphere(
        frames, start, centre_reach=RIVAL_CENTRE_REACH, radius_reach=RIVAL_RADIUS_REACH, camera=camera
    )


def _radius_doubt(rival: Sphere, clear: list[Sphere], shapes: ShapeCircle) -> float:
    """Return the standard deviation of a circle's radius, in pixels, by other clear circles and by what it lacks."""
    differences = [
        circle.radius - rival.radius
        for circle in _distinct(clear, shapes)
        if not _is_same(circle, rival)
        and not _is_horizon(circle, rival)
        and _agreement(circle, shapes) > RIVAL_SHARE * _agreement(rival, shapes)
    ]
    return float(np.hypot(max(differences, key=abs, default=0.0) / 2.0, radius_lacking(rival, shapes)))


def radius_lacking(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return what a circle's radius lacks of the usual one, in pixels; 0 where blur of the highlights explains it."""
    is_small = circle.radius < LEAST_USUAL_RATIO * shapes.max_radius
    return USUAL_RATIO * shapes.max_radius - circle.radius if is_small else 0.0


def _is_horizon(inner: Sphere, outer: Sphere) -> bool:
    """Return whether the inner of two circles may be the horizon's mirror image on the sphere that is the outer one."""
    return HORIZON_RATIOS[0] < inner.radius / outer.radius < HORIZON_RATIOS[1]


def _is_same(first: Sphere, second: Sphere) -> bool:
    return abs(first.radius - second.radius) <= SAME_RADIUS_RATIO * second.radius


def _distinct(circles: list[Sphere], shapes: ShapeCircle) -> list[Sphere]:
    """Return those of some circles with no stronger one of the same radius among them."""
    kept = list[Sphere]()
    for circle in sorted(circles, key=lambda circle: -_agreement(circle, shapes)):
        if not any(_is_same(circle, stronger) for stronger in kept):
            kept.append(circle)
    return kept


def _strongest(circles: list[Sphere], shapes: ShapeCircle) -> Sphere:
    return max(circles, key=lambda circle: _agreement(circle, shapes))


def _agreement(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return the contrast of a circle, weighted by its distance from the highlights' centre."""
    deviations = distance(circle, shapes) / centre_deviation(circle, shapes)
    return circle.score * float(np.exp(-0.5 * (deviations / CENTRE_PENALTY_DEVIATIONS) ** 2))
