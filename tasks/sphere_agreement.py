"""Agreement of the spheres of one object's captures: where camera and spheres stood still, their circles are the same.

A turntable turns the object alone. A circle that one view fits elsewhere than all others is wrong in that view, and
where a view shows its sphere badly or not at all, the others show where it is. A stage of one capture knows nothing of
other captures, so that its key does not depend on them; what is compared here is reported by checks and runs, and
counts in the model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.sphere_doubts import MAX_LIGHT_DEVIATION_DEG

MIN_CAPTURES, MIN_AGREEING_SHARE = 4, 0.7
"""Captures with a sphere at one place, and share of them that must agree, from which camera and sphere stood still."""
MIN_SIBLINGS = 2
"""Captures whose circles agree, from which they are offered to one that shows no sphere, or shows it badly."""
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


def surveyed_spheres(contexts: Sequence[CaptureContext]) -> dict[str, CaptureSpheres]:
    """Return the spheres of captures, by capture id, as their surveys left them.

    Raises:
        StoreError: a capture has not been surveyed.
    """
    geometries = {context.capture.id: load_geometry(context) for context in contexts}
    return {name: CaptureSpheres(entry.frame_size, entry.spheres) for name, entry in geometries.items()}


def sphere_warnings(captures: Mapping[str, CaptureSpheres]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture, of spheres that lie elsewhere, or are known worse, than in the other captures."""
    warnings = deviating_spheres(captures)
    for name, capture in captures.items():
        siblings = [entry for other_name, entry in captures.items() if other_name != name]
        for sphere in capture.spheres:
            # The error has two axes; that of the light is twice that of the half vector.
            deviation = 2.0 * np.sqrt(2.0) * float(np.degrees(sphere.centre_sd / sphere.radius))
            if name in warnings or deviation <= MAX_LIGHT_DEVIATION_DEG:
                continue
            shared = _shared_circles([entry for entry in siblings if entry.frame_size == capture.frame_size])
            near = [circle for circle in shared if _difference(sphere, circle) < SAME_PLACE_RADII]
            if near:
                message = (
                    f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} is known to"
                    f" {100.0 * sphere.centre_sd / sphere.radius:.1f}% of its radius only: {_offer(near)}"
                )
                warnings[name] = [StageWarning(message, "sphere", deviation / 2.0)]
    return warnings


def sphere_offer(context: CaptureContext, siblings: Mapping[str, CaptureSpheres]) -> str:
    """Return what a capture without a usable sphere may be given, by the captures that have one; empty if unknown."""
    video = context.file("frames")
    if video is None:
        return ""
    try:
        with open_footage(video) as footage:
            size = (footage.width, footage.height)
    except InputError:
        return ""
    shared = _shared_circles([entry for entry in siblings.values() if entry.frame_size == size])
    return _offer(shared) if shared else ""


def deviating_spheres(captures: Mapping[str, CaptureSpheres]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture, of spheres that lie elsewhere than in the other captures of an object.

    Captures of another frame size were recorded by another camera, and are compared among themselves.
    """
    warnings: dict[str, list[StageWarning]] = {}
    for name, capture in captures.items():
        alike = [entry for entry in captures.values() if entry.frame_size == capture.frame_size]
        for sphere in capture.spheres:
            usual, count = _usual_circle(sphere, alike, MIN_CAPTURES)
            if usual is not None and _difference(sphere, usual) > DEVIATING_RATIO:
                message = (
                    f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} lies elsewhere in"
                    f" {count} captures of the object: {_offer([usual])}"
                )
                cost = float(np.degrees(_difference(sphere, usual)))
                warnings.setdefault(name, []).append(StageWarning(message, "sphere", cost))
    return warnings


def _offer(circles: Sequence[Sphere]) -> str:
    """Return the remedy: circles as the catalogue takes them."""
    entries = ", ".join(f"{{x: {circle.x:.1f}, y: {circle.y:.1f}, radius: {circle.radius:.1f}}}" for circle in circles)
    return f"if camera and sphere stood still, give this capture `spheres: [{entries}]`, as in the others"


def _shared_circles(captures: Sequence[CaptureSpheres]) -> list[Sphere]:
    """Return the circles on which captures of one frame size agree."""
    circles = list[Sphere]()
    for capture in captures:
        for sphere in capture.spheres:
            usual, _ = _usual_circle(sphere, captures, MIN_SIBLINGS)
            if usual is not None and all(_difference(usual, known) > SAME_PLACE_RADII for known in circles):
                circles.append(usual)
    return circles


def _usual_circle(sphere: Sphere, captures: Sequence[CaptureSpheres], least: int) -> tuple[Sphere | None, int]:
    """Return the circle that most captures have where one has a sphere, and how many; None if they do not agree.

    least: captures that must have a sphere there.
    """
    nearest = [min(entry.spheres, key=sphere.distance) for entry in captures if entry.spheres]
    same = [circle for circle in nearest if _difference(circle, sphere) < SAME_PLACE_RADII]
    if len(same) < least:
        return None, 0
    x, y, radius = np.median([(circle.x, circle.y, circle.radius) for circle in same], axis=0)
    usual = Sphere(float(x), float(y), float(radius))
    agreeing = sum(_difference(circle, usual) < AGREEING_RATIO for circle in same)
    return (usual, agreeing) if agreeing >= MIN_AGREEING_SHARE * len(same) else (None, 0)


def _difference(first: Sphere, second: Sphere) -> float:
    """Return the distance of centres or the difference of radii, whichever is larger, in radii of the second."""
    return max(first.distance(second), abs(first.radius - second.radius)) / second.radius
