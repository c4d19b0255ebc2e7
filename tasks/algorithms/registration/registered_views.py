"""Registration: the pose and the scale of every view, from a turntable or from given matrices.

A turntable is calibrated (turntable), contradictory views are rejected with the reason (view_rejection), and small
errors of the stated scales are corrected (view_scales).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.normal_fusion import fuse_normals
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.pose_alternatives import alternative_poses
from glint.tasks.algorithms.registration.pose_search import refine_pose
from glint.tasks.algorithms.registration.turntable import (
    LEANS_TO_CAMERA_DEG,
    Turntable,
    calibrate_axis,
    calibrate_turntable,
    initial_turntable,
    relative_turns,
    step_factor,
    turntable_consistency,
    views_on_turntable,
)
from glint.tasks.algorithms.registration.view_rejection import RejectedView, mistaken_angles, reject_inconsistent
from glint.tasks.algorithms.registration.view_scales import fit_scales, scaled

MAX_TURN_DEVIATIONS = 1.0
"""Standard deviations of a stated angle by which normals may turn a view from where silhouettes have it: false
highlights agree at other angles too, 2.6 degrees off on a duck and 14 on a faceted bottle whose angles were right."""


@dataclass(frozen=True, slots=True)
class RegisteredViews:
    """Views with their poses, and how these came about.

    views: V views, first the K of the turntable, then those whose poses were given; rejected: those that are not part
    of the model; residuals: mean silhouette residual of each view in pixels; turntable: None if there is none;
    given_angles, angle_errors: (K,) its angles as given, multiplied by `step_factor` where their step was wrong, and
    their standard deviations, degrees; searched: names of views whose pose was not given but searched;
    scale_factors: of the stated pixel sizes that were corrected, by name.
    """

    views: tuple[View, ...]
    rejected: tuple[RejectedView, ...]
    residuals: tuple[float, ...]
    turntable: Turntable | None = None
    given_angles: np.ndarray = field(default_factory=lambda: np.zeros(0))
    angle_errors: np.ndarray = field(default_factory=lambda: np.zeros(0))
    searched: tuple[str, ...] = ()
    step_factor: float = 1.0
    scale_factors: Mapping[str, float] = field(default_factory=dict)


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
    table = calibrate_axis([*views, *posed], initial_turntable(views, angles), LEANS_TO_CAMERA_DEG)
    kept, rejected = _agreeing(views, posed, table)
    if rejected:
        posed = [posed[number - len(views)] for number in kept if number >= len(views)]
        on_table = [number for number in kept if number < len(views)]
        views, angles = [views[number] for number in on_table], [angles[number] for number in on_table]
        _require_two([*views, *posed])
        if not views:
            return RegisteredViews(tuple(posed), tuple(rejected), mean_residuals(posed))
        table = calibrate_axis([*views, *posed], initial_turntable(views, angles), LEANS_TO_CAMERA_DEG)
    stated = np.asarray(angles, float)
    table, errors = mistaken_angles([*views, *posed], table, stated)
    everything, scales = _rescaled(views_on_turntable([*views, *posed], table), table)
    if scales:
        table = calibrate_axis(everything, table)
    factor = step_factor(everything, table, stated, errors)
    given_angles = factor * stated
    solved, _ = calibrate_turntable(everything, table, given_angles, errors)
    registered = RegisteredViews(
        everything, tuple(rejected), (), table, given_angles, errors, step_factor=factor, scale_factors=scales
    )
    return with_turntable(registered, solved)


def register_by_matrices(views: Sequence[View]) -> RegisteredViews:
    """Take the given poses as they are, rejecting contradictory views.

    Raises:
        UnusableCapture: fewer than two views, a pose that is not a rotation, or no views agree.
    """
    _require_two(views)
    _require_rotations(views)
    kept, rejected = _agreeing([], views, None)
    _require_two(kept)
    chosen, scales = _rescaled([views[number] for number in kept], None)
    return RegisteredViews(chosen, tuple(rejected), mean_residuals(chosen), scale_factors=scales)


def _rescaled(views: Sequence[View], table: Turntable | None) -> tuple[tuple[View, ...], dict[str, float]]:
    """Return views with corrected scales, and the factors of those that were corrected; see `fit_scales`."""
    factors = fit_scales(views, table)
    changed = {view.name: float(factor) for view, factor in zip(views, factors, strict=True) if factor != 1.0}
    return tuple(scaled(view, changed[view.name]) if view.name in changed else view for view in views), changed


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
        return replace(registered, views=tuple(views), residuals=mean_residuals(views))
    if len(registered.views) < 3:
        return registered
    fused = fuse_normals(registered.views, model.vertices, model.triangles)
    normals = turntable_consistency(registered.views, registered.turntable, model.vertices, fused)
    solved, _ = calibrate_turntable(
        registered.views, registered.turntable, registered.given_angles, registered.angle_errors, normals
    )
    turns = relative_turns(registered.turntable.angles, solved.angles)
    if (np.abs(turns) > MAX_TURN_DEVIATIONS * registered.angle_errors).any():
        return registered
    return with_turntable(registered, solved)


def with_turntable(registered: RegisteredViews, table: Turntable) -> RegisteredViews:
    """Return the views with the poses of a calibrated turntable."""
    views = views_on_turntable(registered.views, table)
    return replace(registered, views=tuple(views), residuals=mean_residuals(views), turntable=table)


def mean_residuals(views: Sequence[View]) -> tuple[float, ...]:
    """Return the mean silhouette residual of each view in pixels."""
    return tuple(float(residual) for residual in silhouette_residuals(views).mean(axis=1))


def _require_two(views: Sequence[object]) -> None:
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
