"""Views without a pose: registered where they fit a coarse model of the other views (pose_search)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_fit import PoseFit
from glint.tasks.algorithms.registration.pose_search import ambiguity, search_angles, search_rotations
from glint.tasks.algorithms.registration.registered_views import RegisteredViews, mean_residuals, with_turntable
from glint.tasks.algorithms.registration.turntable import calibrate_turntable, views_on_turntable
from glint.tasks.algorithms.registration.view_rejection import MAX_RESIDUAL_PX, RejectedView

SEARCHED_ANGLE_ERROR_DEG = 10.0
"""Standard deviation in degrees of a turntable angle that was searched on a coarse model."""


def register_unposed(registered: RegisteredViews, unposed: Sequence[View], model: Model) -> RegisteredViews:
    """Register views without a pose where they fit a model of the registered views.

    Views that fit nowhere, or at several poses, are rejected.
    """
    for view in unposed:
        result = _register_one_more(registered, view, model)
        if isinstance(result, str):
            rejection = RejectedView(view.name, result, remedy="give its pose")
            result = replace(registered, rejected=(*registered.rejected, rejection))
        registered = result
    return registered


def _register_one_more(registered: RegisteredViews, view: View, model: Model) -> RegisteredViews | str:
    """Return the views with one more where it fits the model, or the reason why it does not."""
    if registered.turntable is None and view.matrix is not None:
        return "its pose is not given, and under a camera matrix it cannot be searched"
    fits = _search_pose(registered, view, model)
    reason = ambiguity(fits)
    if reason is not None:
        return reason
    extended = _with_view(registered, view, fits[0])
    residual = extended.residuals[[other.name for other in extended.views].index(view.name)]
    if residual > MAX_RESIDUAL_PX:
        return f"its pose is not given, and where it fits best it misses by {residual:.1f} pixels"
    return extended


def _search_pose(registered: RegisteredViews, view: View, model: Model) -> list[PoseFit]:
    """Return the poses at which a view fits the model, the best first."""
    table = registered.turntable
    if table is None:
        return search_rotations(view, model)

    def pose(angle: float) -> tuple[np.ndarray, np.ndarray]:
        posed = views_on_turntable([view], replace(table, angles=np.array([angle])))[0]
        return posed.rotation, posed.translation

    return search_angles(view, model, pose)


def _with_view(registered: RegisteredViews, view: View, fit: PoseFit) -> RegisteredViews:
    """Return the views with one more at its best fit; a turntable is calibrated again with it."""
    searched = (*registered.searched, view.name)
    if registered.turntable is None or fit.angle is None:
        views = (*registered.views, view.with_pose(fit.rotation, fit.translation))
        return replace(registered, views=views, residuals=mean_residuals(views), searched=searched)
    on_table = len(registered.turntable.angles)
    views = (*registered.views[:on_table], view, *registered.views[on_table:])
    given_angles = np.append(registered.given_angles, fit.angle)
    errors = np.append(registered.angle_errors, SEARCHED_ANGLE_ERROR_DEG)
    table = replace(registered.turntable, angles=np.append(registered.turntable.angles, fit.angle))
    extended = replace(registered, views=views, given_angles=given_angles, angle_errors=errors, searched=searched)
    return with_turntable(extended, calibrate_turntable(views, table, given_angles, errors)[0])
