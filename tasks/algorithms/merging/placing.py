"""Placing the views: a turntable solved, contradictory views named and left out, angles found where none were given."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tasks.algorithms.errors import UnusableCapture
from tasks.algorithms.merging.fusion import fuse
from tasks.algorithms.merging.hull import Outline, outline_of
from tasks.algorithms.merging.model import Model
from tasks.algorithms.merging.poses import (
    Turntable,
    agreement_of,
    on_turntable,
    solve_axis,
    solve_turntable,
    turntable_of,
)
from tasks.algorithms.merging.tangents import misses
from tasks.algorithms.merging.views import View

CONTRADICTORY = 1.0
"""Mean pixels by which rays through a view's outline may miss the others' hull; more is a wrong pose or mask."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A view that is no part of the model, and why; `angle`: the turntable's angle that would fit it, if one does."""

    name: str
    reason: str
    angle: float | None = None


@dataclass(frozen=True, slots=True)
class Placed:
    """Views where they must have been; those left out; mean misses of each in pixels; the turntable, if it is one, and
    its angles (V,) as they were given."""

    views: tuple[View, ...]
    left_out: tuple[LeftOut, ...]
    misses: tuple[float, ...]
    turntable: Turntable | None = None
    given: np.ndarray = field(default_factory=lambda: np.zeros(0))


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
    given = np.asarray(angles, float)
    return _placed(views, solve_turntable(views, table, given), given, left_out)


def placed_anew(placed: Placed, views: Sequence[View], model: Model) -> Placed:
    """Correct a turntable by the normals that its views, now better known, saw of the model."""
    if placed.turntable is None or len(views) < 3:
        return replace(placed, views=tuple(views))
    fused = fuse(views, model.vertices, model.triangles)
    normals = agreement_of(views, placed.turntable, model.vertices, fused)
    table = solve_turntable(views, placed.turntable, placed.given, normals)
    return _placed(views, table, placed.given, placed.left_out)


def _placed(views: Sequence[View], table: Turntable, given: np.ndarray, left_out: Sequence[LeftOut]) -> Placed:
    placed = on_turntable(views, table)
    return Placed(tuple(placed), tuple(left_out), _mean_misses(placed), table, given)


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
