"""Placing the views: a turntable solved, contradictory views named and left out, angles found where none were given."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.epipolar_tangency import misses
from glint.tasks.algorithms.multiview.normal_fusion import fuse
from glint.tasks.algorithms.multiview.pose_search import Fit, best_angles, best_rotations, doubt, refitted
from glint.tasks.algorithms.multiview.reconstruction import Model
from glint.tasks.algorithms.multiview.turntable import (
    ANGLE_ERROR,
    Turntable,
    agreement_of,
    on_turntable,
    solve_axis,
    solve_turntable,
    turntable_of,
)
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import Outline, outline_of

CONTRADICTORY = 1.0
"""Mean pixels by which rays through a view's outline may miss the others' hull; more is a wrong pose or mask."""

FOUND_ERROR = 10.0
"""Degrees by which a turntable's angle may err that was found on a rough model."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A view that is no part of the model, and why; `angle`: the turntable's angle that would fit it, if one does."""

    name: str
    reason: str
    angle: float | None = None
    remedy: str = "check its pose and its mask"


@dataclass(frozen=True, slots=True)
class Placed:
    """Views where they must have been; those left out; mean misses of each in pixels; the turntable, if it is one, and
    its angles (V,) as they were given and the degrees (V,) by which they may err; names of views whose pose nobody gave
    and that were found."""

    views: tuple[View, ...]
    left_out: tuple[LeftOut, ...]
    misses: tuple[float, ...]
    turntable: Turntable | None = None
    given: np.ndarray = field(default_factory=lambda: np.zeros(0))
    errors: np.ndarray = field(default_factory=lambda: np.zeros(0))
    found: tuple[str, ...] = ()


def place_on_turntable(views: Sequence[View], angles: Sequence[float]) -> Placed:
    """Solve a turntable from the outlines.

    Raises:
        UnusableCapture: fewer than two views, or none agree.
    """
    _enough(views)
    table = solve_axis(views, turntable_of(views, angles))
    kept, left_out = _consistent(views, table)
    if left_out:
        views, angles = [views[each] for each in kept], [angles[each] for each in kept]
        _enough(views)
        table = solve_axis(views, turntable_of(views, angles))
    given, errors = np.asarray(angles, float), np.full(len(views), ANGLE_ERROR)
    solved = solve_turntable(views, table, given, errors=errors)
    return _on_solved(Placed(tuple(views), tuple(left_out), (), table, given, errors), solved)


def placed_anew(placed: Placed, model: Model) -> Placed:
    """Correct a turntable by the normals that its views saw of the model; else, poses that were found."""
    if placed.turntable is None:
        views = [refitted(view, model) if view.name in placed.found else view for view in placed.views]
        return replace(placed, views=tuple(views), misses=_mean_misses(views) if placed.found else placed.misses)
    if len(placed.views) < 3:
        return placed
    fused = fuse(placed.views, model.vertices, model.triangles)
    normals = agreement_of(placed.views, placed.turntable, model.vertices, fused)
    return _on_solved(placed, solve_turntable(placed.views, placed.turntable, placed.given, normals, placed.errors))


def _on_solved(placed: Placed, table: Turntable) -> Placed:
    views = on_turntable(placed.views, table)
    return replace(placed, views=tuple(views), misses=_mean_misses(views), turntable=table)


def place_others(placed: Placed, others: Sequence[View], model: Model) -> Placed:
    """Place views whose pose nobody gave where they fit a model of the views that are placed.

    Those that fit nowhere, or in several places, are left out.
    """
    for view in others:
        found = _with_one_more(placed, view, model)
        if isinstance(found, str):
            found = replace(placed, left_out=(*placed.left_out, LeftOut(view.name, found, remedy="give its pose")))
        placed = found
    return placed


def _with_one_more(placed: Placed, view: View, model: Model) -> Placed | str:
    """With a view where it fits the model, or why it does not."""
    if placed.turntable is None and view.matrix is not None:
        return "its pose is not given, and under a camera matrix it cannot be found"
    fits = _fits(placed, view, model)
    doubtful = doubt(fits)
    if doubtful is not None:
        return doubtful
    wider = _widened(placed, view, fits[0])
    missed = wider.misses[-1]
    if missed > CONTRADICTORY:
        return f"its pose is not given, and where it fits best it misses by {missed:.1f} pixels"
    return wider


def _fits(placed: Placed, view: View, model: Model) -> list[Fit]:
    """Poses at which a view fits, the best first."""
    table = placed.turntable
    if table is None:
        return best_rotations(view, model)

    def pose(angle: float) -> tuple[np.ndarray, np.ndarray]:
        there = on_turntable([view], replace(table, angles=np.array([angle])))[0]
        return there.rotation, there.translation

    return best_angles(view, model, pose)


def _widened(placed: Placed, view: View, fit: Fit) -> Placed:
    """With one more view, where it was found; a turntable is solved again with it."""
    found, views = (*placed.found, view.name), (*placed.views, view.placed(fit.rotation, fit.translation))
    if placed.turntable is None or fit.angle is None:
        return replace(placed, views=views, misses=_mean_misses(views), found=found)
    given, errors = np.append(placed.given, fit.angle), np.append(placed.errors, FOUND_ERROR)
    table = replace(placed.turntable, angles=np.append(placed.turntable.angles, fit.angle))
    views = (*placed.views, view)
    wider = replace(placed, views=views, given=given, errors=errors, found=found)
    return _on_solved(wider, solve_turntable(views, table, given, errors=errors))


def place_by_matrices(views: Sequence[View]) -> Placed:
    """Take the given poses as they are, but for views that contradict the others.

    Raises:
        UnusableCapture: fewer than two views, a pose that is no rotation, or none agree.
    """
    _enough(views)
    for view in views:
        if not np.allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(view.rotation) < 0:
            raise UnusableCapture(
                f"the pose of {view.name} is no rotation",
                "give camera_to_world with orthogonal unit columns: camera x right, y up, z to the camera",
            )
    kept, left_out = _consistent(views, None)
    chosen = [views[each] for each in kept]
    _enough(chosen)
    return Placed(tuple(chosen), tuple(left_out), _mean_misses(chosen))


def _consistent(views: Sequence[View], table: Turntable | None) -> tuple[list[int], list[LeftOut]]:
    """Indices of the views whose outlines agree, and those without which the others agree better."""
    outlines = [outline_of(view.mask) for view in views]
    placed = list(views) if table is None else on_turntable(views, table)
    kept, left_out = list(range(len(views))), list[LeftOut]()
    while len(kept) > 2:
        now = misses([placed[each] for each in kept], [outlines[each] for each in kept]).mean(axis=1)
        if now.max() <= CONTRADICTORY:
            break
        without = [
            misses([placed[each] for each in kept if each != one], [outlines[each] for each in kept if each != one])
            .mean(axis=1)
            .max()
            for one in kept
        ]
        worst = kept[int(np.argmin(without))]
        kept = [each for each in kept if each != worst]
        angle = None if table is None else _fitting_angle(worst, kept, placed, outlines, table)
        reason = f"its outline contradicts the others' by {now.max():.1f} pixels"
        if table is not None and angle is not None:
            by = _apart(float(table.angles[worst]), angle)
            reason += f"; it would fit at {angle % 360:.1f} degrees, {by:+.1f} from what was given"
        left_out.append(LeftOut(views[worst].name, reason, angle))
    return kept, left_out


def _fitting_angle(
    one: int, kept: Sequence[int], placed: Sequence[View], outlines: Sequence[Outline], table: Turntable
) -> float | None:
    """The angle at which a view agrees with the others, None if at no angle."""
    others, theirs = [placed[each] for each in kept], [outlines[each] for each in kept]

    def miss(angle: float) -> float:
        turned = replace(table, angles=np.where(np.arange(len(table.angles)) == one, angle, table.angles))
        view = on_turntable(placed, turned)[one]
        return float(misses([*others, view], [*theirs, outlines[one]], 24).mean())

    tried = np.arange(0.0, 360.0, 6.0)
    best = float(tried[np.argmin([miss(angle) for angle in tried])])
    for step in (2.0, 0.5):
        near = best + step * np.arange(-2, 3)
        best = float(near[np.argmin([miss(angle) for angle in near])])
    return best if miss(best) <= CONTRADICTORY else None


def _mean_misses(views: Sequence[View]) -> tuple[float, ...]:
    found = misses(views, [outline_of(view.mask) for view in views]).mean(axis=1)
    return tuple(float(each) for each in found)


def _apart(first: float, second: float) -> float:
    return (second - first + 180.0) % 360.0 - 180.0


def _enough(views: Sequence[View]) -> None:
    if len(views) < 2:
        raise UnusableCapture(
            f"{len(views)} view{'s' * (len(views) != 1)} with a pose that fits: a model needs two, eight are good",
            "film the object from more sides, and give each capture its pose",
        )
