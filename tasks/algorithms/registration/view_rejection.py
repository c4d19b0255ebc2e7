"""Rejection of views whose silhouette contradicts the other views: a wrong pose, or a wrong mask.

Greedy leave-one-out selection on the silhouette residuals (epipolar_tangency): as long as a view misses the hull of the
others by more than MAX_RESIDUAL_PX, the view whose removal makes the rest most consistent is rejected.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.turntable import Turntable, views_on_turntable

MAX_RESIDUAL_PX = 1.0
"""Largest mean silhouette residual in pixels of a view that agrees with the others."""
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
    remedy: str = "check its pose and its mask"


def reject_inconsistent(views: Sequence[View], table: Turntable | None) -> tuple[list[int], list[RejectedView]]:
    """Return the indices of the views whose silhouettes agree, and the views rejected.

    table: the turntable on which the first views stand; the poses of the others, and of all if it is None, are taken as
    they are.
    """
    posed = list(views) if table is None else views_on_turntable(views, table)
    kept, rejected = list(range(len(views))), list[RejectedView]()
    # Of two views that disagree, either may be wrong: at least two are kept.
    while len(kept) > 2:
        residuals = _mean_residuals(posed, kept)
        if residuals.max() <= MAX_RESIDUAL_PX:
            break
        remaining = [[number for number in kept if number != removed] for removed in kept]
        worst = kept[int(np.argmin([_mean_residuals(posed, numbers).max() for numbers in remaining]))]
        kept = [number for number in kept if number != worst]
        on_table = table is not None and worst < len(table.angles)
        angle = _fitting_angle(worst, kept, posed, table) if table is not None and on_table else None
        reason = f"its silhouette contradicts the others' by {residuals.max():.1f} pixels"
        if table is not None and angle is not None:
            change = angle_difference(float(table.angles[worst]), angle)
            reason += f"; it would fit at {angle % 360:.1f} degrees, {change:+.1f} from the given angle"
        rejected.append(RejectedView(views[worst].name, reason, angle))
    return kept, rejected


def angle_difference(first: float, second: float) -> float:
    """Return second minus first in degrees, in -180..180."""
    return (second - first + 180.0) % 360.0 - 180.0


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
    return best if residual(best) <= MAX_RESIDUAL_PX else None
