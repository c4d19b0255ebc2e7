"""The spheres of a capture that are used: given or found ones, compared with their contours, rims and highlights."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.sphere_detection import CANDIDATE_FRAMES, FIT_FRAMES
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.consistent_spheres import ContradictedSphere, consistent_spheres
from glint.tasks.algorithms.near_light.half_vector_error import USUAL_NZ
from glint.tasks.algorithms.sphere_checks.circle_check import CheckedCircle, check_circle
from glint.tasks.algorithms.sphere_checks.given_circle import (
    HAND_REACH_RATIO,
    UNKNOWN_DEVIATION_RATIO,
    ConfirmedSphere,
    beside,
    confirm_sphere,
    hand_reach,
    is_elsewhere,
    judged,
)
from glint.tasks.algorithms.sphere_checks.mirrored_rim import settled_rim, with_mirrored_rim
from glint.tasks.algorithms.sphere_checks.rival_circle import radius_lacking
from glint.tasks.algorithms.sphere_checks.shape_agreement import (
    MIN_CONTRADICTION_DEVIATIONS,
    beside_highlights,
    contradicts,
)
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.sphere_doubts import DISAGREEMENT_DEVIATIONS

CORRECTION_DEVIATIONS = 2.3
"""Standard deviations from which highlights contradict a fit that would replace a given circle, which stands against it
(`python -m tests.benchmarks.spheres_given`)."""
RIM_CORRECTION_RATIO = 0.03
"""Difference from a given circle, in radii, from which that of its rim replaces it: of spheres above the table these
are up to 2% too large."""
MIN_OWN_CONTRAST, HAND_DEVIATION_RATIO = 0.5, 0.06
"""Contrast of a given circle, relative to that of an edge beside it, below which it has no edge of its own (right ones
have 0.75 and more), and the standard deviation of its radius then: by hand one errs by 6%."""


def confirm_given(
    frames: np.ndarray, given: list[Sphere], camera: np.ndarray | None
) -> tuple[list[Sphere], list[StageWarning]]:
    """Measure given spheres; return those to be used, and a warning where the frames contradict what was given."""
    frames = spread(frames, FIT_FRAMES)
    confirmed = [_confirm(frames, sphere, camera) for sphere in given]
    return [sphere for sphere, _ in confirmed], [warning for _, warning in confirmed if warning is not None]


def _confirm(frames: np.ndarray, given: Sphere, camera: np.ndarray | None) -> tuple[Sphere, StageWarning | None]:
    """Measure a given sphere; return the one to be used, and a warning where the frames contradict what was given."""
    confirmed = confirm_sphere(frames, given, camera=camera)
    of_rim = _of_rim(frames, given, confirmed, camera)
    if of_rim is not None:
        return of_rim
    # A fit that replaces the given circle is judged by its own deviation, without the doubt between the two.
    circle = confirmed.fit if confirmed.is_corrected else confirmed.sphere
    deviations = CORRECTION_DEVIATIONS if confirmed.is_corrected else MIN_CONTRADICTION_DEVIATIONS
    check = check_circle(frames, circle, camera=camera, deviations=deviations)
    if check.is_contradicted:
        return _against_highlights(given, confirmed, check)
    return _corrected(given, confirmed, check) if confirmed.is_corrected else _kept(given, confirmed, check)


def _of_rim(
    frames: np.ndarray, given: Sphere, confirmed: ConfirmedSphere, camera: np.ndarray | None
) -> tuple[Sphere, StageWarning | None] | None:
    """Return the sphere by the rim that it mirrors; None: no rim is seen, or the highlights contradict it."""
    rim = settled_rim(frames, replace(given, score=confirmed.fit.score), camera, HAND_REACH_RATIO)
    if rim is None or check_circle(frames, rim.sphere, deviations=CORRECTION_DEVIATIONS).is_contradicted:
        return None
    difference = max(given.distance(rim.sphere), abs(given.radius - rim.sphere.radius))
    if is_elsewhere(given, rim.sphere) and difference > RIM_CORRECTION_RATIO * given.radius:
        return rim.sphere, _correction(given, rim.sphere, rim.sphere)
    return beside(given, rim.sphere), None


def _corrected(given: Sphere, confirmed: ConfirmedSphere, check: CheckedCircle) -> tuple[Sphere, StageWarning]:
    """Return the fit that replaces a given circle, and the warning that it does.

    An edge inside the contour that touches it has a smaller radius as well as another centre. Whoever drew the given
    circle bounds how much smaller.
    """
    largest = given.radius + hand_reach(given.radius)
    lacking = 0.0 if check.shapes is None else radius_lacking(confirmed.fit, check.shapes)
    lacking = min(lacking, max(largest - confirmed.fit.radius, 0.0))
    used = replace(confirmed.sphere, radius_sd=float(np.hypot(confirmed.sphere.radius_sd, lacking)))
    return used, _correction(given, confirmed.fit, used)


def _kept(given: Sphere, confirmed: ConfirmedSphere, check: CheckedCircle) -> tuple[Sphere, StageWarning | None]:
    """Return a given circle that stands, and a warning where another one is clearer or its contour is not seen."""
    fit, shapes = confirmed.fit, check.shapes
    if shapes is not None and is_elsewhere(given, fit) and contradicts(shapes, fit, CORRECTION_DEVIATIONS):
        # What the highlights refute leaves no doubt about the given circle, unless they then contradict that too.
        used = beside_highlights(given, shapes, UNKNOWN_DEVIATION_RATIO * given.radius)
        if not contradicts(shapes, used):
            confirmed = replace(confirmed, sphere=used)
    if confirmed.is_clear and not confirmed.is_disputed:
        return confirmed.sphere, None
    if confirmed.is_disputed:
        message = (
            f"{_place(given)} is used as it is, although a circle at ({fit.x:.1f}, {fit.y:.1f}) with radius"
            f" {fit.radius:.1f} is clearer: compare both with the frame, and put a plain background behind the sphere"
        )
    else:
        message = (
            f"{_place(given)} is used as it is, since its contour is not seen: compare it with the frame, and put a"
            " plain background behind the sphere"
        )
    return confirmed.sphere, _warning(message, confirmed.sphere)


def _against_highlights(given: Sphere, confirmed: ConfirmedSphere, check: CheckedCircle) -> tuple[Sphere, StageWarning]:
    """Return the sphere to be used, and a warning, where highlights contradict a given circle or the fit that replaces
    it: if they contradict the fit alone, the given one stands against it, and its contrast decides between it and a
    circle that they allow."""
    fit, shapes = check.before, check.shapes
    assert shapes is not None
    unknown = UNKNOWN_DEVIATION_RATIO * given.radius
    stated = replace(given, centre_sd=unknown, radius_sd=unknown)
    if not confirmed.is_corrected or contradicts(shapes, stated):
        return check.sphere, _contradiction(check, given)
    radius_sd = unknown
    # An edge inside the sphere about its centre is smaller than blur of the highlights explains.
    is_inside = radius_lacking(check.sphere, shapes) > 0.0 and radius_lacking(given, shapes) == 0.0
    if check.is_replaced and not is_inside:
        other = judged(given, replace(check.sphere, score=check.contrast), confirmed.given_contrast * fit.score)
        if other.is_corrected:
            return other.sphere, _correction(given, other.fit, other.sphere)
        radius_sd = other.sphere.radius_sd
    elif confirmed.given_contrast < MIN_OWN_CONTRAST:
        radius_sd = HAND_DEVIATION_RATIO * given.radius
    used = beside_highlights(given, shapes, radius_sd)
    message = (
        f"{_place(given)} is used as it is: a clearer circle, at ({fit.x:.1f}, {fit.y:.1f}) with radius"
        f" {fit.radius:.1f}, contradicts the shapes of the highlights: compare it with the frame, and put a plain"
        " background behind the sphere"
    )
    return used, _warning(message, used)


def _place(given: Sphere) -> str:
    return f"the sphere given at ({given.x:.1f}, {given.y:.1f}) with radius {given.radius:.1f}"


def _warning(message: str, used: Sphere) -> StageWarning:
    """Return a warning that costs what the centre of the sphere that is used is off, in degrees of its normals."""
    return StageWarning(message, "sphere", float(np.degrees(used.centre_sd / used.radius)))


def _correction(given: Sphere, fit: Sphere, used: Sphere) -> StageWarning:
    """Return the warning that a fit replaces a given circle."""
    message = (
        f"{_place(given)} is seen at ({fit.x:.1f}, {fit.y:.1f}) with radius {fit.radius:.1f}, which is used: correct"
        " `spheres` in the catalogue"
    )
    return _warning(message, used)


def confirm_found(
    frames: np.ndarray, spheres: Sequence[Sphere], camera: np.ndarray | None
) -> tuple[list[Sphere], list[StageWarning]]:
    """Compare found spheres with their rims and highlights, and with one another; return those to be used.

    Also returned are a warning where the highlights contradict a circle, and one of each sphere that is left out since
    its lights contradict the others'. Of two, the one stays that agrees better with its own highlights; where these
    refute neither, the one that stays is as uncertain as the two differ.

    Args:
        frames: (T, H, W) uint8, spread over the capture.
        spheres: best first, in the frames' pixels.
        camera: perspective camera's matrix (3, 3).
    """
    many = spread(frames, FIT_FRAMES)
    measured = [with_mirrored_rim(many, sphere, camera) for sphere in spheres]
    checked = [check_circle(many, sphere, camera=camera) for sphere in measured]
    checked.sort(key=attrgetter("misfit"))
    used, left_out = consistent_spheres(spread(frames, CANDIDATE_FRAMES), [check.sphere for check in checked], camera)
    warnings = [_contradiction(check) for check in checked if check.is_contradicted and check.sphere in used]
    is_refuted = {check.sphere: check.is_contradicted for check in checked}
    errors = [_undecided_error(contradicted, is_refuted) for contradicted in left_out]
    for contradicted, error in zip(left_out, errors, strict=True):
        # The error has two axes.
        warnings.append(StageWarning(str(contradicted), "sphere", float(np.degrees(np.sqrt(2.0) * error))))
    if left_out:
        reference, error = left_out[0].reference, max(errors)
        used = [_doubted(sphere, error) if sphere == reference else sphere for sphere in used]
    return used, warnings


def _undecided_error(contradicted: ContradictedSphere, is_refuted: Mapping[Sphere, bool]) -> float:
    """Return the error, radians per axis, of half vectors of a reference that another sphere contradicts.

    It is 0 where a third sphere or the highlights decide which of the two is right, or the fits explain the difference;
    else either is wrong as likely as the other.

    is_refuted: whether its own highlights contradict a sphere.
    """
    sphere, reference, angle = contradicted.sphere, contradicted.reference, np.radians(contradicted.angle_deg)
    deviations = [float(circle.half_vector_sd(np.array(USUAL_NZ))) for circle in (sphere, reference)]
    explained = float(np.sqrt(2.0) * np.linalg.norm(deviations))
    is_decided = contradicted.is_outvoted or (is_refuted[sphere] and not is_refuted[reference])
    return 0.0 if is_decided or angle < DISAGREEMENT_DEVIATIONS * explained else float(angle / 2.0)


def _doubted(sphere: Sphere, error: float) -> Sphere:
    """Return a sphere whose centre is off by what an error of its half vectors, radians per axis, amounts to."""
    return replace(sphere, centre_sd=float(np.hypot(sphere.centre_sd, error * sphere.radius)))


def _contradiction(check: CheckedCircle, given: Sphere | None = None) -> StageWarning:
    """Return the warning of a circle, found or given, that the highlights contradict."""
    circle, used, shapes = check.before, check.sphere, check.shapes
    assert shapes is not None
    replacement = f"the one at ({used.x:.1f}, {used.y:.1f}) with radius {used.radius:.1f} is used"
    outcome = replacement if check.is_replaced else "no other circle is clear"
    clearest = f"the clearest circle, at ({circle.x:.1f}, {circle.y:.1f}) with radius {circle.radius:.1f},"
    subject, remedy = (clearest, "give") if given is None else (_place(given), "correct")
    message = (
        f"{subject} contradicts the shapes of the highlights, which are those on a sphere at"
        f" ({shapes.x:.1f}, {shapes.y:.1f}) with a radius of at most {shapes.max_radius:.1f}; {outcome}: compare it"
        f" with the frame, and {remedy} `spheres` in the catalogue"
    )
    return _warning(message, used)
