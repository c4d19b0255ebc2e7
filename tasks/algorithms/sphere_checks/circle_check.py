"""Circles of chrome spheres against the shapes of their highlights, and the circle that agrees with both.

The strongest circle may be an edge inside the sphere that touches its contour, or one around it and what lies beside
it: 5 to 60% of the radius off, with a contrast of its own, so that no measure of the edge tells. The shapes of the
highlights do. About the centre that they show, and below the radius that they allow, the contour is sought again.
"""

from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.lighting.spheres import MIN_CLEAR_CONTRAST, Sphere, measure_sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import ShapeCircle, circle_of_highlights

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
MAX_SEARCH_SD_RATIO = 0.04
"""Standard deviation of the highlights' centre, and of the logarithm of their radius, beyond which no other circle is
sought."""
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


@dataclass(frozen=True, slots=True)
class CheckedCircle:
    """A circle and what the highlights say of it.

    sphere: what is to be used; before: the circle that was checked; shapes: what the highlights say, None where it is
    nothing. is_contradicted: they contradict the circle; is_replaced: another circle, which agrees with them, is used;
    contrast: of that one's contour.
    """

    sphere: Sphere
    before: Sphere
    shapes: ShapeCircle | None
    is_contradicted: bool = False
    is_replaced: bool = False
    contrast: float = 0.0

    @property
    def misfit(self) -> float:
        """Distance of its centre from that of the highlights, in standard deviations.

        Infinite where they contradict it but no other circle is clear, the usual one where they say nothing.
        """
        if self.shapes is None:
            return USUAL_DEVIATIONS
        if self.is_contradicted and not self.is_replaced:
            return float("inf")
        circle = self.sphere if self.is_replaced else self.before
        return _distance(circle, self.shapes) / _centre_deviation(circle, self.shapes)


def check_circle(
    frames: np.ndarray,
    sphere: Sphere,
    *,
    camera: np.ndarray | None = None,
    deviations: float = MIN_CONTRADICTION_DEVIATIONS,
) -> CheckedCircle:
    """Compare a circle with the shapes of the highlights; seek another one where they contradict it.

    Where no circle agrees with them the given one is kept, and its standard deviations include what it is off. One
    that they do not contradict is known worse in proportion, where they differ more than their deviations let expect.

    Args:
        frames: (T, H, W) uint8, spread over the capture.
        sphere: with its standard deviations, in the frames' pixels.
        camera: perspective camera's matrix (3, 3).
        deviations: standard deviations from which the two contradict each other.
    """
    shapes = circle_of_highlights(frames, sphere, camera=camera)
    if shapes is None:
        return CheckedCircle(sphere, sphere, None)
    if not contradicts(shapes, sphere, deviations):
        doubted = replace(sphere, centre_sd=sphere.centre_sd * _birge_ratio(sphere, shapes))
        return CheckedCircle(doubted, sphere, shapes)
    rival = _rival(frames, sphere, shapes, camera)
    if rival is not None:
        return CheckedCircle(
            replace(rival, score=sphere.score),
            sphere,
            shapes,
            is_contradicted=True,
            is_replaced=True,
            contrast=rival.score,
        )
    doubted = replace(
        sphere,
        centre_sd=float(np.hypot(sphere.centre_sd, _distance(sphere, shapes) / np.sqrt(2.0))),
        radius_sd=float(np.hypot(sphere.radius_sd, max(sphere.radius - shapes.max_radius, 0.0))),
    )
    return CheckedCircle(doubted, sphere, shapes, is_contradicted=True)


def contradicts(shapes: ShapeCircle, sphere: Sphere, deviations: float = MIN_CONTRADICTION_DEVIATIONS) -> bool:
    """Return whether the shapes of highlights contradict a circle: its centre, or that it is so large.

    deviations: standard deviations from which they do.
    """
    centre_sd, systematic = _centre_deviation(sphere, shapes), SYSTEMATIC_RATIO * sphere.radius
    radius_sd = np.sqrt(sphere.radius_sd**2 + (shapes.log_radius_sd * shapes.max_radius) ** 2 + systematic**2)
    return bool(
        _distance(sphere, shapes) > max(MIN_CONTRADICTION_RATIO * sphere.radius, deviations * centre_sd)
        or sphere.radius - shapes.max_radius > max(MAX_EXCESS_RATIO * sphere.radius, deviations * radius_sd)
    )


def beside_highlights(circle: Sphere, shapes: ShapeCircle, radius_sd: float) -> Sphere:
    """Return a circle that the highlights allow, with the deviation that their shapes leave its centre."""
    difference = float(np.hypot(circle.x - shapes.x, circle.y - shapes.y)) / np.sqrt(2.0)
    centre_sd = max(shapes.sd, difference, SYSTEMATIC_RATIO * circle.radius)
    return replace(circle, centre_sd=centre_sd, radius_sd=radius_sd)


def _rival(frames: np.ndarray, sphere: Sphere, shapes: ShapeCircle, camera: np.ndarray | None) -> Sphere | None:
    """Return the circle with the most contrast about the highlights' centre; None: none is clear and agrees.

    Its centre is the mean of its own and the highlights', by their precision.
    """
    spread = max(shapes.sd / sphere.radius, shapes.log_radius_sd)
    log_ratio = float(np.log(shapes.max_radius / sphere.radius))
    if spread > MAX_SEARCH_SD_RATIO or not SEARCH_LOG_RATIOS[0] < log_ratio < SEARCH_LOG_RATIOS[1]:
        return None
    # Refined fits search farther, and would find the edge again that misled the first one.
    circles = [
        measure_sphere(
            frames,
            replace(sphere, x=shapes.x, y=shapes.y, radius=ratio * shapes.max_radius),
            centre_reach=RIVAL_CENTRE_REACH,
            radius_reach=RIVAL_RADIUS_REACH,
            camera=camera,
        )
        for ratio in RIVAL_RADIUS_RATIOS
    ]
    clear = [circle for circle in circles if circle.score >= MIN_CLEAR_CONTRAST and not contradicts(shapes, circle)]
    if not clear:
        return None
    rival = _strongest(clear, shapes)
    outer = [circle for circle in clear if _is_horizon(rival, circle)]
    if outer:
        rival = _strongest(outer, shapes)
    systematic = SYSTEMATIC_RATIO * rival.radius
    own, other = rival.centre_sd**2 + systematic**2, shapes.sd**2 + systematic**2
    share = other / (own + other)
    return replace(
        rival,
        x=share * rival.x + (1.0 - share) * shapes.x,
        y=share * rival.y + (1.0 - share) * shapes.y,
        centre_sd=float(np.sqrt(share * own)) * _birge_ratio(rival, shapes),
        radius_sd=float(np.hypot(rival.radius_sd, _radius_doubt(rival, clear, shapes))),
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
    deviations = _distance(circle, shapes) / _centre_deviation(circle, shapes)
    return circle.score * float(np.exp(-0.5 * (deviations / CENTRE_PENALTY_DEVIATIONS) ** 2))


def _birge_ratio(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return the factor, at least 1, by which two measurements of the centre differ more than their deviations let
    expect (Birge 1932)."""
    return max(_distance(circle, shapes) / (USUAL_DEVIATIONS * _centre_deviation(circle, shapes)), 1.0)


def _centre_deviation(circle: Sphere, shapes: ShapeCircle) -> float:
    """Return the standard deviation per axis, in pixels, of the difference of the two centres."""
    return float(np.sqrt(circle.centre_sd**2 + shapes.sd**2 + (SYSTEMATIC_RATIO * circle.radius) ** 2))


def _distance(sphere: Sphere, shapes: ShapeCircle) -> float:
    """Return the distance of a circle's centre from that of the highlights in pixels."""
    return float(np.hypot(sphere.x - shapes.x, sphere.y - shapes.y))
