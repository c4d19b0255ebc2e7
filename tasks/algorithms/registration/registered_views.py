"""Registration: the pose of every view, from a turntable, from given matrices, or searched on a coarse model.

A turntable is calibrated (turntable), contradictory views are rejected with the reason (view_rejection), views without
a pose are registered where they fit a coarse model of the other views (pose_search).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.normal_fusion import fuse_normals
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.pose_alternatives import alternative_poses
from glint.tasks.algorithms.registration.pose_fit import PoseFit
from glint.tasks.algorithms.registration.pose_search import ambiguity, refine_pose, search_angles, search_rotations
from glint.tasks.algorithms.registration.turntable import (
    ANGLE_ERROR_DEG,
    Turntable,
    calibrate_axis,
    calibrate_turntable,
    initial_turntable,
    relative_turns,
    step_factor,
    turntable_consistency,
    views_on_turntable,
)
from glint.tasks.algorithms.registration.view_rejection import MAX_RESIDUAL_PX, RejectedView, reject_inconsistent

SEARCHED_ANGLE_ERROR_DEG = 10.0
"""Standard deviation in degrees of a turntable angle that was searched on a coarse model."""
MAX_TURN_DEVIATIONS = 1.0
"""Standard deviations of a stated angle by which normals may turn a view from where silhouettes have it: false
highlights agree at other angles too, 2.6 degrees off on a duck and 14 on a faceted bottle whose angles were right."""


@dataclass(frozen=True, slots=True)
class RegisteredViews:
    """Views with their poses, and how these came about.

    views: V views, first the K of the turntable, then those whose poses were given; rejected: those that are not part
    of the model; residuals: mean silhouette residual of each view in pixels; turntable: None if there is none;
    given_angles, angle_errors: (K,) its angles as given, multiplied by `step_factor` where their step was wrong, and
    their standard deviations, degrees; searched: names of views whose pose was not given but searched.
    """

    views: tuple[View, ...]
    rejected: tuple[RejectedView, ...]
    residuals: tuple[float, ...]
    turntable: Turntable | None = None
    given_angles: np.ndarray = field(default_factory=lambda: np.zeros(0))
    angle_errors: np.ndarray = field(default_factory=lambda: np.zeros(0))
    searched: tuple[str, ...] = ()
    step_factor: float = 1.0


def register_on_turntable(
    views: Sequence[View], angles: Sequence[float], posed: Sequence[View] = ()
) -> RegisteredViews:
    """Calibrate a turntable from the silhouettes of views at given angles (degrees), rejecting contradictory views.

    posed: further views, with their poses in the turntable's world, which take part in the calibration.

    Raises:
        UnusableCapture: fewer than two views, a pose that is not a rotation, or none agree.
    """
    _require_two([*views, *posed])
    _require_rotations(posed)
    views, angles, posed = list(views), list(angles), list(posed)
    table = calibrate_axis([*views, *posed], initial_turntable(views, angles))
    kept, rejected = _agreeing(views, posed, table)
    if rejected:
        posed = [posed[number - len(views)] for number in kept if number >= len(views)]
        on_table = [number for number in kept if number < len(views)]
        views, angles = [views[number] for number in on_table], [angles[number] for number in on_table]
        _require_two([*views, *posed])
        if not views:
            return RegisteredViews(tuple(posed), tuple(rejected), _mean_residuals(posed))
        table = calibrate_axis([*views, *posed], initial_turntable(views, angles))
    errors, everything = np.full(len(views), ANGLE_ERROR_DEG), (*views, *posed)
    factor = step_factor(everything, table, np.asarray(angles, float))
    given_angles = factor * np.asarray(angles, float)
    solved = calibrate_turntable(everything, table, given_angles, angle_errors=errors)
    registered = RegisteredViews(everything, tuple(rejected), (), table, given_angles, errors, step_factor=factor)
    return _with_turntable(registered, solved)


def register_by_matrices(views: Sequence[View]) -> RegisteredViews:
    """Take the given poses as they are, rejecting contradictory views.

    Raises:
        UnusableCapture: fewer than two views, a pose that is not a rotation, or no views agree.
    """
    _require_two(views)
    _require_rotations(views)
    kept, rejected = _agreeing([], views, None)
    chosen = [views[number] for number in kept]
    _require_two(chosen)
    return RegisteredViews(tuple(chosen), tuple(rejected), _mean_residuals(chosen))


def _agreeing(
    on_table: Sequence[View], posed: Sequence[View], table: Turntable | None
) -> tuple[list[int], list[RejectedView]]:
    """Return the indices of the views that agree, first those on the table, then the posed ones, and those rejected.

    Raises:
        UnusableCapture: it is not clear which views are wrong, or they all agree at other poses.
    """
    views = [*on_table, *posed]

    def calibrate(kept: Sequence[int], table: Turntable) -> Turntable:
        chosen = [number for number in kept if number < len(on_table)]
        if not chosen:
            return table
        given = initial_turntable([views[number] for number in chosen], table.angles[chosen].tolist())
        return replace(calibrate_axis([views[number] for number in kept], given), angles=table.angles)

    try:
        kept, rejected = reject_inconsistent(views, table, calibrate)
        doubt = None
    except UnusableCapture as error:
        kept, rejected, doubt = [], [], error
    # One wrong view is a mistake of its own; several may have the same cause.
    is_alike = table is None or not posed
    alternative = alternative_poses(views, table) if is_alike and (doubt is not None or len(rejected) > 1) else None
    if doubt is not None:
        remedy = doubt.remedy if alternative is None else f"all agree if {alternative}"
        raise UnusableCapture(doubt.message, remedy) from doubt
    if alternative is not None:
        names = ", ".join(view.name for view in rejected)
        raise UnusableCapture(f"the silhouettes of {names} contradict the others'", f"all agree if {alternative}")
    return kept, rejected


def refine(registered: RegisteredViews, model: Model) -> RegisteredViews:
    """Refine the poses on a model: a turntable by the consistency of normals, else the poses that were searched.

    Normals that would turn a view by much leave the turntable as it is.
    """
    if registered.turntable is None:
        if not registered.searched:
            return registered
        views = [refine_pose(view, model) if view.name in registered.searched else view for view in registered.views]
        return replace(registered, views=tuple(views), residuals=_mean_residuals(views))
    if len(registered.views) < 3:
        return registered
    fused = fuse_normals(registered.views, model.vertices, model.triangles)
    normals = turntable_consistency(registered.views, registered.turntable, model.vertices, fused)
    solved = calibrate_turntable(
        registered.views, registered.turntable, registered.given_angles, normals, registered.angle_errors
    )
    turns = relative_turns(registered.turntable.angles, solved.angles)
    if (np.abs(turns) > MAX_TURN_DEVIATIONS * registered.angle_errors).any():
        return registered
    return _with_turntable(registered, solved)


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
        return replace(registered, views=views, residuals=_mean_residuals(views), searched=searched)
    on_table = len(registered.turntable.angles)
    views = (*registered.views[:on_table], view, *registered.views[on_table:])
    given_angles = np.append(registered.given_angles, fit.angle)
    errors = np.append(registered.angle_errors, SEARCHED_ANGLE_ERROR_DEG)
    table = replace(registered.turntable, angles=np.append(registered.turntable.angles, fit.angle))
    extended = replace(registered, views=views, given_angles=given_angles, angle_errors=errors, searched=searched)
    return _with_turntable(extended, calibrate_turntable(views, table, given_angles, angle_errors=errors))


def _with_turntable(registered: RegisteredViews, table: Turntable) -> RegisteredViews:
    """Return the views with the poses of a calibrated turntable."""
    views = views_on_turntable(registered.views, table)
    return replace(registered, views=tuple(views), residuals=_mean_residuals(views), turntable=table)


def _mean_residuals(views: Sequence[View]) -> tuple[float, ...]:
    """Return the mean silhouette residual of each view in pixels."""
    return tuple(float(residual) for residual in silhouette_residuals(views).mean(axis=1))


def _require_two(views: Sequence[View]) -> None:
    """Raise UnusableCapture if there are fewer than two views."""
    if len(views) < 2:
        raise UnusableCapture(
            f"{len(views)} view{'s' * (len(views) != 1)} with a pose that fits: a model needs two, eight are good",
            "record the object from more sides, and give each capture its pose",
        )


def _require_rotations(views: Sequence[View]) -> None:
    """Raise UnusableCapture if the pose of a view is scaled or mirrored."""
    for view in views:
        if not np.allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(view.rotation) < 0:
            raise UnusableCapture(
                f"the pose of {view.name} is not a rotation",
                "give camera_to_world with orthogonal unit columns: camera x right, y up, z to the camera",
            )
