"""Circles of chrome spheres against the shapes of their highlights, and the circle that agrees with both.

The strongest circle may be an edge inside the sphere that touches its contour, or one around it and what lies beside
it: 5 to 60% of the radius off, with a contrast of its own, so that no measure of the edge tells. The shapes of the
highlights do.
"""

from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import ShapeCircle, circle_of_highlights
from glint.tasks.algorithms.sphere_checks.rival_circle import rival_circle
from glint.tasks.algorithms.sphere_checks.shape_agreement import (
    MIN_CONTRADICTION_DEVIATIONS,
    USUAL_DEVIATIONS,
    birge_ratio,
    centre_deviation,
    contradicts,
    distance,
    with_highlights,
)


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
        return distance(circle, self.shapes) / centre_deviation(circle, self.shapes)


def check_circle(
    frames: np.ndarray,
    sphere: Sphere,
    *,
    camera: np.ndarray | None = None,
    deviations: float = MIN_CONTRADICTION_DEVIATIONS,
) -> CheckedCircle:
    """Compare a circle with the shapes of the highlights; seek another one where they contradict it.

    Where no circle agrees with them the given one is kept, and its standard deviations include what it is off. Where
    the two differ more than their deviations let expect, though without contradiction, a circle takes its place that is
    clearer or nearer to the highlights' centre; without one its centre is the mean of both.

    Args:
        frames: (T, H, W) uint8, spread over the capture.
        sphere: with its standard deviations, in the frames' pixels.
        camera: perspective camera's matrix (3, 3).
        deviations: standard deviations from which the two contradict each other.
    """
    shapes = circle_of_highlights(frames, sphere, camera=camera)
    if shapes is None:
        return CheckedCircle(sphere, sphere, None)
    is_contradicted = contradicts(shapes, sphere, deviations)
    if not is_contradicted and birge_ratio(sphere, shapes) == 1.0:
        return CheckedCircle(sphere, sphere, shapes)
    rival = rival_circle(frames, sphere, shapes, camera, is_contradicted=is_contradicted)
    if rival is not None:
        return CheckedCircle(
            replace(rival, score=sphere.score),
            sphere,
            shapes,
            is_contradicted=is_contradicted,
            is_replaced=True,
            contrast=rival.score,
        )
    if not is_contradicted:
        return CheckedCircle(with_highlights(sphere, shapes), sphere, shapes)
    doubted = replace(
        sphere,
        centre_sd=float(np.hypot(sphere.centre_sd, distance(sphere, shapes) / np.sqrt(2.0))),
        radius_sd=float(np.hypot(sphere.radius_sd, max(sphere.radius - shapes.max_radius, 0.0))),
    )
    return CheckedCircle(doubted, sphere, shapes, is_contradicted=True)
