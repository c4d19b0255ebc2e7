"""Corrections of a turntable's stated angles: small ones are the accuracy of its scale, a large one is a mistake."""

import numpy as np
from scipy.stats import theilslopes

from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import ANGLE_ERROR_DEG, relative_turns
from glint.tasks.engine.stage_warning import StageWarning

MAX_CORRECTION_DEG = 3.0
"""Correction of an angle, beside that of all, beyond which it is reported: scales are read to about a degree."""
MAX_STEP_DEVIATIONS = 3.0
"""Correction of the step of all angles beyond which it is reported, in standard deviations of what single angles that
are read to a degree make of it."""


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
    is_stated = np.array([view.name not in registered.searched for view in registered.views[: len(corrections)]])
    step, warnings = _step_correction(registered.given_angles, corrections, is_stated), list[StageWarning]()
    if step:
        warnings.append(
            StageWarning(
                f"all angles of the turntable were multiplied by {1.0 + step:.3f} to agree with the silhouettes:"
                " compare the step that is stated with the turntable's",
                "views",
            )
        )
        corrections = relative_turns((1.0 + step) * registered.given_angles, table.angles)
    return warnings + [
        StageWarning(
            f"the turntable's angle of {view.name} is stated as {given:g} degrees, and was corrected by"
            f" {correction:+.1f} to agree with the silhouettes of the others: compare the angles of all views with"
            " what the turntable showed, since the wrong one may be another's, and take more views in between",
            "views",
        )
        for view, given, correction in zip(registered.views, registered.given_angles, corrections, strict=False)
        if abs(correction) > MAX_CORRECTION_DEG and view.name not in registered.searched
    ]


def _step_correction(given: np.ndarray, corrections: np.ndarray, is_stated: np.ndarray) -> float:
    """Return the relative change of the step that the corrections (K,) of given angles (K,) have in common, 0 if none.

    is_stated (K,) bool: which angles were stated, and not searched.
    """
    if is_stated.sum() < 3:
        return 0.0
    angles, change = given[is_stated], corrections[is_stated] - np.median(corrections[is_stated])
    # The median slope (Theil and Sen) hardly follows a single wrong angle, and does not explain the others then.
    step, start = theilslopes(change, angles)[:2]
    left = np.median(np.abs(change - start - step * angles))
    is_clear = abs(step) * np.sqrt(len(angles)) * angles.std() > MAX_STEP_DEVIATIONS * ANGLE_ERROR_DEG
    return float(step) if is_clear and left < np.median(np.abs(change)) / 2 else 0.0
