"""Corrections of stated angles and scales: small ones are the accuracy of the statement, a large one is a mistake."""

from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import relative_turns
from glint.tasks.engine.stage_warning import StageWarning

MAX_CORRECTION_DEG = 3.0
"""Correction of an angle, beside that of all, beyond which it is reported: scales are read to about a degree."""
USUAL_SCALE_CORRECTION = 0.0125
"""Relative correction of a view's scale beyond which it is reported: spheres give it to a percent."""


def correction_warnings(registered: RegisteredViews) -> list[StageWarning]:
    """Return a warning of each scale and angle that was corrected by much, and of the step of all angles.

    A view with a wrong angle is rejected where the others contradict it. Few views, or views that face each other, may
    instead move others until all silhouettes agree, on a wrong shape.
    """
    return _scale_warnings(registered) + _angle_warnings(registered)


def corrected_views(registered: RegisteredViews) -> set[str]:
    """Return the names of the views of which the scale or the angle was corrected by more than is usual."""
    return _corrected_scales(registered).keys() | _corrected_angles(registered).keys()


def _corrected_scales(registered: RegisteredViews) -> dict[str, float]:
    """Return the factors of the scales that were corrected by more than is usual, by view."""
    factors = registered.scale_factors.items()
    return {name: factor for name, factor in factors if abs(factor - 1.0) > USUAL_SCALE_CORRECTION}


def _corrected_angles(registered: RegisteredViews) -> dict[str, tuple[float, float]]:
    """Return the given angles that were corrected by more than is usual, and their corrections, degrees, by view."""
    if registered.turntable is None:
        return {}
    # The angle of the whole turntable is nobody's mistake.
    corrections = relative_turns(registered.given_angles, registered.turntable.angles)
    return {
        view.name: (given, correction)
        for view, given, correction in zip(registered.views, registered.given_angles, corrections, strict=False)
        if abs(correction) > MAX_CORRECTION_DEG and view.name not in registered.searched
    }


def _scale_warnings(registered: RegisteredViews) -> list[StageWarning]:
    return [
        StageWarning(
            f"the scale of {name} was corrected by {100.0 * (factor - 1.0):+.1f}% to agree with the silhouettes of the"
            " others: the camera was moved or zoomed, or the `pixel_size` or a sphere of this view is wrong",
            "views",
        )
        for name, factor in _corrected_scales(registered).items()
    ]


def _angle_warnings(registered: RegisteredViews) -> list[StageWarning]:
    if registered.turntable is None:
        return []
    factor, warnings = registered.step_factor, list[StageWarning]()
    if factor != 1.0:
        warnings.append(
            StageWarning(
                f"all angles of the turntable were multiplied by {factor:.3f} to agree with the silhouettes:"
                " compare the step that is stated with the turntable's",
                "views",
            )
        )
    return warnings + [
        StageWarning(
            f"the turntable's angle of {name} is stated as {given / factor:g} degrees, and was corrected by"
            f" {correction:+.1f} to agree with the silhouettes of the others: compare the angles of all views with"
            " what the turntable showed, since the wrong one may be another's, and take more views in between",
            "views",
        )
        for name, (given, correction) in _corrected_angles(registered).items()
    ]
