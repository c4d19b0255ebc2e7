"""Agreement of the spheres of one object's captures: where camera and spheres stood still, their circles are the same.

A turntable turns the object alone. A circle that one view fits elsewhere than all others is wrong in that view.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage_warning import StageWarning

MIN_CAPTURES, MIN_AGREEING_SHARE = 4, 0.7
"""Captures with a sphere at one place, and share of them that must agree, from which camera and sphere stood still."""
SAME_PLACE_RADII = 0.3
"""Distance of centres, and difference of radii, in radii, within which two captures show the same sphere."""
AGREEING_RATIO, DEVIATING_RATIO = 0.01, 0.02
"""Distance of centres or difference of radii, in radii, up to which circles agree, and beyond which one deviates: fits
are within 1% of the radius."""


@dataclass(frozen=True, slots=True)
class CaptureSpheres:
    """frame_size: (width, height) in pixels; spheres: in pixels of the full frame."""

    frame_size: tuple[int, int]
    spheres: Sequence[Sphere]


def deviating_spheres(captures: Mapping[str, CaptureSpheres]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture, of spheres that lie elsewhere than in the other captures of an object.

    Captures of another frame size were recorded by another camera, and are compared among themselves.
    """
    warnings: dict[str, list[StageWarning]] = {}
    for name, capture in captures.items():
        alike = [entry for entry in captures.values() if entry.frame_size == capture.frame_size]
        for sphere in capture.spheres:
            usual, count = _usual_circle(sphere, alike)
            if usual is not None and _difference(sphere, usual) > DEVIATING_RATIO:
                message = (
                    f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} lies at"
                    f" ({usual.x:.1f}, {usual.y:.1f}) with radius {usual.radius:.1f} in {count} captures of the object:"
                    " if camera and sphere stood still, give that circle as `spheres` of this capture too"
                )
                cost = float(np.degrees(_difference(sphere, usual)))
                warnings.setdefault(name, []).append(StageWarning(message, "sphere", cost))
    return warnings


def _usual_circle(sphere: Sphere, captures: Sequence[CaptureSpheres]) -> tuple[Sphere | None, int]:
    """Return the circle that most captures have where one has a sphere, and how many; None if they do not agree."""
    nearest = [min(entry.spheres, key=sphere.distance) for entry in captures if entry.spheres]
    same = [circle for circle in nearest if _difference(circle, sphere) < SAME_PLACE_RADII]
    if len(same) < MIN_CAPTURES:
        return None, 0
    x, y, radius = np.median([(circle.x, circle.y, circle.radius) for circle in same], axis=0)
    usual = Sphere(float(x), float(y), float(radius))
    agreeing = sum(_difference(circle, usual) < AGREEING_RATIO for circle in same)
    return (usual, agreeing) if agreeing >= MIN_AGREEING_SHARE * len(same) else (None, 0)


def _difference(first: Sphere, second: Sphere) -> float:
    """Return the distance of centres or the difference of radii, whichever is larger, in radii of the second."""
    return max(first.distance(second), abs(first.radius - second.radius)) / second.radius
