"""Corrections of a turntable's stated angles: small ones are the accuracy of its scale, a large one is a mistake."""

from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import relative_turns
from glint.tasks.engine.stage_warning import StageWarning

MAX_CORRECTION_DEG = 3.0
"""Correction of an angle, beside that of all, beyond which it is reported: scales are read to about a degree."""


def correction_warnings(registered: RegisteredViews) -> list[StageWarning]:
    """Return a warning if the step of the stated angles was corrected by much, and for each further large correction.

    A view with a wrong angle is rejected where the others contradict it. Few views, or views that face each other, may
    instead move others until all silhouettes agree, on a wrong shape.
    """
    table = registered.turntable
    if table is None:
        return []
    # The angle of the whole turntable is nobody's mistake.
    corrections = relative_turns(registered.given_angles, table.angles)
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
            f"the turntable's angle of {view.name} is stated as {given / factor:g} degrees, and was corrected by"
            f" {correction:+.1f} to agree with the silhouettes of the others: compare the angles of all views with"
            " what the turntable showed, since the wrong one may be another's, and take more views in between",
            "views",
        )
        for view, given, correction in zip(registered.views, registered.given_angles, corrections, strict=False)
        if abs(correction) > MAX_CORRECTION_DEG and view.name not in registered.searched
    ]
