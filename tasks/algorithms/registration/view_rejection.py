"""Rejection of views whose silhouette contradicts the other views: a wrong pose, or a wrong mask.

Greedy leave-one-out selection on the silhouette residuals (epipolar_tangency): as long as a view misses the hull of the
others by more than MAX_RESIDUAL_PX, the view whose removal makes the rest most consistent is rejected. Which views are
wrong is known only while most agree, and as long as no other choice would make the rest agree as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.turntable import (
    ANGLE_ERROR_DEG,
    Turntable,
    calibrate_axis,
    calibrate_turntable,
    relative_turns,
    views_on_turntable,
    wrapped,
)
from glint.tasks.algorithms.registration.view_agreement import USUAL_TOTAL_SHARE, view_agreement

MAX_RESIDUAL_PX = 1.0
"""Largest mean silhouette residual in pixels of a view that agrees with the others."""
CLEAR_RESIDUAL_PX = 0.4
"""Largest residual in pixels of views that agree clearly."""
FITTING_RESIDUAL_PX = 0.05
"""Residual in pixels up to which a view fits at an angle, or the largest one of the others, if their masks are worse: a
right mask at its angle has 0.01, one that is three pixels too large or too small 0.1 to 0.5 where it fits best."""
MIN_KEPT_SHARE = 2.0 / 3.0
"""Share of the views that must agree: fewer may agree by chance, on a wrong shape."""
MISTAKEN_ANGLE_ERROR_DEG, MISTAKE_RATE = 30.0, 0.01
"""Standard deviation in degrees of a stated angle that is a mistake, and how many are."""
MIN_DOUBTED_TURN_DEG = 2.0
"""Turn of a view by the silhouettes from which its angle, or another one, may be a mistake."""
MIN_TOLD_VIEWS = 5
"""Views from which it is known which angle is a mistake: fewer agree at many angles."""
SEARCH_RAYS, LAST_RAYS = 24, 96
"""Rays by which the angle of a rejected view is searched, and in the last step, in which few rays hardly differ."""


@dataclass(frozen=True, slots=True)
class RejectedView:
    """A view that is not part of the model, and the reason.

    angle: the turntable angle in degrees at which it would fit, None if there is none.
    """

    name: str
    reason: str
    angle: float | None = None
    remedy: str = "check its pose, its mask and its scale"


def reject_inconsistent(
    views: Sequence[View],
    table: Turntable | None,
    calibrate: Callable[[Sequence[int], Turntable], Turntable],
) -> tuple[list[int], list[RejectedView]]:
    """Return the indices of the views whose silhouettes agree, and the views rejected.

    table: the turntable on which the first views stand; the poses of the others, and of all if it is None, are taken as
    they are. calibrate(kept, table): the table with its axis fitted to the views of these indices: a wrong view bends
    the axis away from right ones.

    Raises:
        UnusableCapture: the views contradict each other, and it is not clear which of them are wrong.
    """
    posed = _posed(views, table)
    kept, rejected = list(range(len(views))), list[RejectedView]()
    while (residuals := _mean_residuals(posed, kept)).max() > MAX_RESIDUAL_PX:
        if len(kept) == 2:
            _refuse(views, kept, residuals.max())
        remaining = [[number for number in kept if number != removed] for removed in kept]
        misfits = np.array([_mean_residuals(posed, numbers).max() for numbers in remaining])
        worst = kept[int(misfits.argmin())]
        clear = [number for number, misfit in zip(kept, misfits, strict=True) if misfit <= CLEAR_RESIDUAL_PX]
        if len(clear) > 1:
            wrong = _by_normals(posed, kept, clear)
            if len(wrong) != 1:
                _refuse(views, clear, residuals.max())
            worst = wrong[0]
        kept = [number for number in kept if number != worst]
        if len(kept) < MIN_KEPT_SHARE * len(views):
            _refuse(views, [number for number in range(len(views)) if number not in kept], residuals.max())
        reason, angle = f"its silhouette contradicts the others' by {residuals.max():.1f} pixels", None
        if table is not None:
            table = calibrate(kept, table)
            posed = _posed(views, table)
            angle = _fitting_angle(worst, kept, posed, table) if worst < len(table.angles) else None
            if angle is not None:
                change = wrapped(angle - table.angles[worst])
                reason += f"; it would fit at {angle % 360:.1f} degrees, {change:+.1f} from the given angle"
        rejected.append(RejectedView(views[worst].name, reason, angle))
    return kept, rejected


def mistaken_angles(views: Sequence[View], table: Turntable, stated: np.ndarray) -> tuple[Turntable, np.ndarray]:
    """Return a turntable with the mistakes among its stated angles solved, and the angles' standard deviations (K,).

    Most angles are stated to a degree, a few are mistakes: their errors have a heavy tail. Silhouettes that agree
    nearly as well at many angles would spread a mistake over several views. So each angle in turn is taken for the
    mistake, and the best of these fits counts if it is more probable than that without (a mixture of two normal
    distributions).

    views: those on the table first; table: its axis fitted at the stated angles (K,), degrees.
    """
    errors = np.full(len(stated), ANGLE_ERROR_DEG)
    solved, cost = calibrate_turntable(views, table, stated, errors)
    least_gain = np.log(MISTAKEN_ANGLE_ERROR_DEG / ANGLE_ERROR_DEG) - np.log(MISTAKE_RATE)
    while len(views) >= MIN_TOLD_VIEWS and (errors > ANGLE_ERROR_DEG).sum() < (1.0 - MIN_KEPT_SHARE) * len(views) - 1.0:
        held = errors == ANGLE_ERROR_DEG
        if np.abs(relative_turns(stated, solved.angles))[held].max(initial=0.0) < MIN_DOUBTED_TURN_DEG:
            break
        fits = {}
        for number in np.flatnonzero(held):
            loosened = np.where(np.arange(len(stated)) == number, MISTAKEN_ANGLE_ERROR_DEG, errors)
            fits[number] = calibrate_turntable(views, table, stated, loosened)
        best = min(fits, key=lambda number: fits[number][1])
        if cost - fits[best][1] < least_gain:
            break
        errors[best] = MISTAKEN_ANGLE_ERROR_DEG
        solved, cost = calibrate_turntable(views, fits[best][0], stated, errors)
        corrected = np.where(errors > ANGLE_ERROR_DEG, solved.angles, stated)
        table = calibrate_axis(views, replace(solved, angles=corrected))
    return table, errors


def _posed(views: Sequence[View], table: Turntable | None) -> list[View]:
    return list(views) if table is None else views_on_turntable(views, table)


def _by_normals(posed: Sequence[View], kept: Sequence[int], doubted: Sequence[int]) -> list[int]:
    """Return those of the doubted views without which the normals of all others agree."""
    wrong = []
    for removed in doubted:
        remaining = [posed[number] for number in kept if number != removed]
        if view_agreement(remaining, coarse_model(remaining)).share >= USUAL_TOTAL_SHARE:
            wrong.append(removed)
    return wrong


def _refuse(views: Sequence[View], doubted: Sequence[int], residual: float) -> NoReturn:
    """Raise UnusableCapture for views that contradict each other when it is not clear which of them are wrong."""
    names = ", ".join(views[number].name for number in doubted)
    raise UnusableCapture(
        f"the silhouettes of {len(views)} views contradict each other by {residual:.1f} pixels, and too few agree to"
        f" know which are wrong: at least one of {names}",
        "check the poses of all views (for a turntable the angles, by their step and direction; for matrices axes and"
        " unit), their masks and their scale",
    )


def _mean_residuals(views: Sequence[View], chosen: Sequence[int]) -> np.ndarray:
    """Return the mean silhouette residual in pixels of each chosen view against the hull of the other chosen ones."""
    return np.asarray(silhouette_residuals([views[number] for number in chosen]).mean(axis=1))


def _fitting_angle(number: int, kept: Sequence[int], posed: Sequence[View], table: Turntable) -> float | None:
    """Return the turntable angle at which view `number` agrees with the kept ones, None if there is none."""
    kept_views = [posed[index] for index in kept]

    def residual(angle: float, rays: int = SEARCH_RAYS) -> float:
        angles = np.where(np.arange(len(table.angles)) == number, angle, table.angles)
        view = views_on_turntable(posed, replace(table, angles=angles))[number]
        return float(silhouette_residuals([*kept_views, view], rays).mean())

    candidates = np.arange(0.0, 360.0, 6.0)
    best = float(candidates[np.argmin([residual(angle) for angle in candidates])])
    for step, rays in ((2.0, SEARCH_RAYS), (0.5, LAST_RAYS)):
        nearby = best + step * np.arange(-2, 3)
        best = float(nearby[np.argmin([residual(angle, rays) for angle in nearby])])
    largest = max(FITTING_RESIDUAL_PX, float(_mean_residuals(posed, kept).max()))
    return best if residual(best, LAST_RAYS) <= largest else None
