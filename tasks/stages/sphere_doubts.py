"""Doubt of the spheres: what their fits leave uncertain in the half vectors, and where two of them disagree."""

from collections.abc import Sequence

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.lighting.lights import ACCEPTED, BEHIND, Lights, inter_sphere_angles
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.half_vector_error import spheres_error
from glint.tasks.engine.stage_warning import StageWarning

MAX_LIGHT_DEVIATION_DEG = 2.2
"""Standard deviation of the lights' directions, from the spheres' fits, above which they are doubted."""
MIN_DISAGREEMENT_DEG, DISAGREEMENT_DEVIATIONS = 0.6, 2.5
"""Median angle between a sphere's half vectors and the mean that is doubted: at least, and in standard deviations."""
MIN_RADIUS_PX, SMALL_SPHERE_DEG = 19.5, 20.0
"""Radius of a sphere that was not given below which it is doubted, and the error of its half vectors then: the guide
asks for 40 pixels across, and the contour of a smaller one can vanish beside the edge of what it mirrors. Of 17 found
with smaller radii on simulated captures, four were no sphere at all, with errors of 40 degrees that nothing stated."""
MIN_OUTVOTED_DEG = 5.0
"""Median angle between a sphere's half vectors and those of all that counts as left out, by default."""
MAX_BEHIND_SHARE, SMALL_CIRCLE_DEG = 0.1, 7.0
"""Share of the highlights beyond r sin 45 from which the circle may be an edge inside the sphere, and the error of the
half vectors that it has then."""


def sweep_error(spheres: Sequence[Sphere], result: Lights) -> float:
    """Return the RMS of `spheres_error` over all accepted lights, radians; 0 without lights."""
    errors = spheres_error(spheres, result.half_vectors[result.accepted, 2])
    return float(np.sqrt(np.mean(errors**2))) if errors.size else 0.0


def inner_edge_error(result: Lights) -> float:
    """Return the standard deviation per axis, radians, of half vectors whose circle may be an edge inside the sphere.

    It is 0 where few highlights lie near the contour.
    """
    is_doubted = _share_near_contour(result) > MAX_BEHIND_SHARE
    return float(np.radians(SMALL_CIRCLE_DEG) / np.sqrt(2.0)) if is_doubted else 0.0


def circles_error(spheres: Sequence[Sphere], result: Lights, *, is_near: bool) -> float:
    """Return the error, radians per axis, of half vectors that the spheres' fits do not state; see `sphere_doubts`.

    It is `inner_edge_error`, that of small spheres that were found, and that of spheres which disagree: their mean may
    be off by as much as each is from it.
    """
    angle = None if is_near else _disagreement_angle(spheres, result)
    size_deg = SMALL_SPHERE_DEG if _smallest_radius(spheres) < MIN_RADIUS_PX else 0.0
    shared = np.radians([0.0 if angle is None else angle, size_deg]) / np.sqrt(2.0)
    return float(np.hypot(inner_edge_error(result), np.linalg.norm(shared)))


def sphere_doubts(
    spheres: Sequence[Sphere],
    result: Lights,
    *,
    is_near: bool,
    is_given: bool,
    by_sphere: Sequence[Lights] = (),
) -> list[StageWarning]:
    """Warn where the spheres leave the light uncertain, of the most costly cause alone, and of spheres left out.

    spheres: in pixels of the full frame; result: the lights of all of them; is_near: whether these are corrected for
    the parallax of a near light, so that spheres may disagree; is_given: whether a person gave the spheres; by_sphere:
    the lights of each before they were merged.
    """
    outvoted = [] if is_near else _outvoted(spheres, result, by_sphere)
    return [*outvoted, *_uncertain(spheres, result, is_near=is_near, is_given=is_given)]


def _outvoted(spheres: Sequence[Sphere], result: Lights, by_sphere: Sequence[Lights]) -> list[StageWarning]:
    """Return warnings of spheres that are left out since the others agree against them; see `merge_spheres`."""
    warnings = []
    for sphere, lights in zip(spheres, by_sphere, strict=False):
        shared = lights.accepted & result.accepted
        difference = angles(lights.half_vectors[shared], result.half_vectors[shared])
        if shared.any() and (angle := float(np.median(difference))) > MIN_OUTVOTED_DEG:
            message = (
                f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) is left out: its half vectors are {angle:.1f} degrees"
                " from those on which the others agree: correct `spheres` in the catalogue"
            )
            warnings.append(StageWarning(message, "sphere"))
    return warnings


def _uncertain(spheres: Sequence[Sphere], result: Lights, *, is_near: bool, is_given: bool) -> list[StageWarning]:
    """Return the warning of the most costly cause, if there is any; see `sphere_doubts`."""
    possible = (
        _contour_doubt(spheres, result, is_given),
        _size_doubt(spheres, is_given),
        _inner_edge_doubt(spheres, result, is_given),
    )
    doubts = [doubt for doubt in possible if doubt is not None]
    if not doubts and not is_near and (disagreement := _disagreement(spheres, result)) is not None:
        return [disagreement]
    return sorted(doubts, key=lambda doubt: -doubt.cost_deg)[:1]


def _contour_doubt(spheres: Sequence[Sphere], result: Lights, is_given: bool) -> StageWarning | None:
    """Return a warning of contours that are known too coarsely for the directions to the light."""
    # The error has two axes; that of the light is twice that of the half vector.
    error = float(np.degrees(sweep_error(spheres, result))) * np.sqrt(2.0)
    if not 2.0 * error > MAX_LIGHT_DEVIATION_DEG:
        return None
    worst = max(spheres, key=_contour_percent)
    place = "" if len(spheres) == 1 else f" at ({worst.x:.1f}, {worst.y:.1f})"
    message = (
        f"the contour of the chrome sphere{place} is known to {_contour_percent(worst):.1f}% of its radius only, so"
        f" lights may be off by {2.0 * error:.1f} degrees: use a plain background unlike the sphere's rim, or"
        + (" a larger sphere" if is_given else " give `spheres` in the catalogue")
    )
    return StageWarning(message, "sphere", error)


def _size_doubt(spheres: Sequence[Sphere], is_given: bool) -> StageWarning | None:
    """Return a warning of a sphere that is small and was found, or measured in place of a given circle."""
    smallest = _smallest_radius(spheres)
    if smallest >= MIN_RADIUS_PX:
        return None
    message = (
        f"the chrome sphere was found with a radius of {smallest:.1f} pixels, too few to distinguish its contour from"
        " an edge inside it: use a sphere of at least 40 pixels across"
        + ("" if is_given else ", or give `spheres` in the catalogue")
    )
    return StageWarning(message, "sphere", SMALL_SPHERE_DEG)


def _smallest_radius(spheres: Sequence[Sphere]) -> float:
    """Return the smallest radius in pixels of spheres that were found, infinite if all were given."""
    # A given circle that stands has the score 1.
    return min((sphere.radius for sphere in spheres if sphere.score < 1.0), default=float("inf"))


def _inner_edge_doubt(spheres: Sequence[Sphere], result: Lights, is_given: bool) -> StageWarning | None:
    """Return a warning of highlights that lie where only those on a circle inside the contour do."""
    behind = _share_near_contour(result)
    if behind <= MAX_BEHIND_SHARE:
        return None
    where = f" at ({spheres[0].x:.1f}, {spheres[0].y:.1f})" if len(spheres) == 1 else "s"
    message = (
        f"{behind:.0%} of the highlights lie near the contour of the chrome sphere{where}, as if the light were behind"
        " the object: check in the picture that the circle is the sphere's contour and no smaller one inside it, or"
        f" {'correct' if is_given else 'give'} `spheres` in the catalogue"
    )
    return StageWarning(message, "sphere", SMALL_CIRCLE_DEG)


def _share_near_contour(result: Lights) -> float:
    """Return the share of the highlights that lie so near the contour as those of lights behind the object."""
    highlights = (result.reason == ACCEPTED) | (result.reason == BEHIND)
    return float((result.reason[highlights] == BEHIND).mean()) if highlights.any() else 0.0


def _disagreement(spheres: Sequence[Sphere], result: Lights) -> StageWarning | None:
    """Return a warning of spheres whose half vectors differ by more than their contours explain."""
    angle = _disagreement_angle(spheres, result)
    if angle is None:
        return None
    message = (
        f"the spheres disagree on the half vectors by {2.0 * angle:.1f} degrees: check `spheres` in the catalogue,"
        " or leave out the worse sphere"
    )
    return StageWarning(message, "sphere", 2.0 * angle)


def _disagreement_angle(spheres: Sequence[Sphere], result: Lights) -> float | None:
    """Return the median angle in degrees between spheres' half vectors and their middle; None: their fits explain it.

    result: the lights of all spheres.
    """
    median, _ = inter_sphere_angles(result)
    # Disagreement is measured from the middle of all spheres, which have the same weight in it.
    middle_error = np.linalg.norm([sweep_error([sphere], result) for sphere in spheres]) / len(spheres)
    expected = DISAGREEMENT_DEVIATIONS * float(np.degrees(middle_error)) * np.sqrt(2.0)
    return median if median > max(MIN_DISAGREEMENT_DEG, expected) else None


def _contour_percent(sphere: Sphere) -> float:
    """Return the standard deviation of a sphere's centre or radius, whichever is larger, in percent of its radius."""
    return 100.0 * max(sphere.centre_sd, sphere.radius_sd) / sphere.radius
