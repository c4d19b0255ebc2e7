"""Relief that repeats round a surface of revolution: hobnails, ribs, cuts.

Seen from the axis, a relief of n periods shows the same normals in each of them. Those of one period, which face the
light differently from the next, fill what the others lack: flanks too steep for a highlight on one side of the vessel
are seen on the other. Candidates that repeat prove the relief, and are the true ones: false ones depend on what lies
behind, and do not repeat.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from operator import attrgetter

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.periodic_places import ObservedPlaces, Places, exceeds_chance
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution

PERIODS = range(8, 61)
"""Numbers of periods that are tried; fewer are the faces of a prism rather than a relief."""
MIN_OBSERVED, MIN_REPEATED = 0.5, 0.12
"""Share of the pixels at which candidates can be compared, and of these the share whose candidates repeat."""
MAX_BY_CHANCE = 0.35
"""Share whose candidates repeat after parts of a period, as those of a smooth wall do after any angle."""
PROBED_PERIODS, SMOOTH_BY_CHANCE = 16, 0.5
"""Number of periods by which a smooth wall is told before others are tried, and share that then repeats by chance."""
MIN_AMPLITUDE_DEG = 5.0
"""RMS angle of repeated candidates from their circles' means: 2 to 4 degrees on smooth walls, 6 and more on reliefs."""
MAX_MEDIAN_DEG = 4.5
"""Median angle of accepted normals from those with relief: up to 4.1 degrees on vessels, 5 and more on cut stones."""
MIN_FIRST_AGREEMENT = 0.008
"""Mean agreement in excess of chance at the tilt of the surface, below which nothing is refined."""
SEARCHED_PIXELS = 30_000
"""Pixels in which a relief is looked for."""
MIN_SUPPORT = 0.05
"""Normals per cell that count as much as a surface without relief."""
ERROR_CAP_DEG = 20.0
"""Cap of an angle, so that false normals do not decide."""
FIRST_THICKNESS, MAX_THICKNESS = 0.02, 0.1
"""Depth of the relief as a share of the largest radius: the first that is tried, and the largest."""
FIRST_TURN_DEG, FINAL_TURN_DEG, MAX_TURN_DEG = 2.0, 0.3, 7.0
"""Steps of the tilt at which the refinement of both begins and ends, and its largest correction."""
TURN_LOSS = 0.3
"""Share of its agreement that a relief loses by the largest correction: upright ribs repeat under any tilt."""


def capped_angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles in degrees between normals (..., 3), at most ERROR_CAP_DEG, which NaN counts as."""
    return np.asarray(np.minimum(np.nan_to_num(angles(first, second), nan=ERROR_CAP_DEG), ERROR_CAP_DEG))


@dataclass(frozen=True, eq=False)
class Relief:
    """Relief on a surface of revolution.

    surface: the one that touches the silhouette. thickness: in pixels, between it and the circles on which the relief
    repeats. periods: round the axis. fit: share of the pixels that repeat in excess of chance. x, y: (M,), camera
    frame, of the pixels that show it. shown: (K, M, 3), their candidates.
    """

    surface: SurfaceOfRevolution
    thickness: float
    periods: int
    fit: float
    x: np.ndarray
    y: np.ndarray
    shown: np.ndarray

    def normals(self, x: np.ndarray, y: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Return the unit normals (N, 3) with relief.

        Args:
            x: (N,), camera frame.
            y: (N,).
            base: (N, 3), normals of the surface without relief, which remain where the relief shows nothing.
        """
        places = Places.on(self._body, x, y)
        relief, support = places.means(*self._repeated, self.periods)
        weight = np.where(places.hit, self._circles[places.row] * support / (support + MIN_SUPPORT), 0.0)[:, None]
        result = np.where(weight > 0.0, weight * relief, 0.0) + (1.0 - weight) * base
        # What would be turned away is hidden by a nearer part of the relief, whose contour is beside it.
        result[:, 2] = np.maximum(result[:, 2], 0.0)
        return np.asarray(unit(result))

    @cached_property
    def _body(self) -> SurfaceOfRevolution:
        return self.surface.shrunk(self.thickness)

    @cached_property
    def _observed(self) -> ObservedPlaces:
        return ObservedPlaces.at(Places.on(self._body, self.x, self.y), self.shown)

    @cached_property
    def _repeated(self) -> tuple[Places, np.ndarray]:
        return self._observed.repeated_normals(self.periods)

    @cached_property
    def _circles(self) -> np.ndarray:
        return self._observed.circles_with_relief(self.periods)


def find_relief(
    mask: np.ndarray,
    surface: SurfaceOfRevolution,
    x: np.ndarray,
    y: np.ndarray,
    accepted: np.ndarray,
    candidates: np.ndarray,
) -> Relief | None:
    """Find the relief of a surface, and the tilt under which it repeats; None if there is none.

    Accepted normals show it best if most of them are true; else all candidates do. It may contradict half of them.

    Args:
        mask: (H, W) bool, the silhouette.
        surface: the largest one in it.
        x: (N,), camera frame, of all its pixels or a sample.
        y: (N,).
        accepted: (N, 3), NaN where there is none.
        candidates: (K, N, 3), NaN where there is none.
    """
    reliefs = [_relief_of(mask, surface, x, y, shown) for shown in (accepted[None], candidates)]
    relief = max((relief for relief in reliefs if relief is not None), key=attrgetter("fit"), default=None)
    if relief is None:
        return None
    known = np.isfinite(accepted[:, 0])
    x, y, accepted = x[known], y[known], accepted[known]
    base = relief.surface.with_fitted_slopes(x, y, accepted).normals(x, y)
    contradiction = np.median(capped_angles(relief.normals(x, y, base), accepted))
    return relief if contradiction <= MAX_MEDIAN_DEG else None


def _relief_of(
    mask: np.ndarray, surface: SurfaceOfRevolution, x: np.ndarray, y: np.ndarray, shown: np.ndarray
) -> Relief | None:
    """Return the relief that candidates (K, N, 3) show, see `find_relief`."""
    has_candidate = np.flatnonzero(np.isfinite(shown[..., 0]).any(axis=0))
    searched = np.random.default_rng(0).permutation(has_candidate)[:SEARCHED_PIXELS]
    candidates = shown[:, searched]
    cell = max(1.0, np.sqrt(mask.sum() / len(x) * len(has_candidate) / SEARCHED_PIXELS))
    radius = float(np.sqrt(surface.squared_radii.max()))

    def observed_under(tilt: float, thickness: float) -> ObservedPlaces:
        body = surface.tilted(mask, tilt, step=1.0).shrunk(thickness * radius)
        return ObservedPlaces.at(Places.on(body, x[searched], y[searched], cell), candidates)

    @cache
    def fits(tilt: float, thickness: float, counts: range) -> tuple[float, int]:
        """Return how well the best of some numbers of periods fits, and that number."""
        turn = abs(tilt - surface.tilt) / np.radians(MAX_TURN_DEG)
        if turn > 1.0 or not 0.0 <= thickness <= MAX_THICKNESS:
            return -np.inf, 0
        observed = observed_under(tilt, thickness)
        agreement, count = max((observed.excess(count).agreement, count) for count in counts)
        # Places that are turned away leave those that agree best.
        return (1.0 - TURN_LOSS * turn**2) * agreement * len(observed.places.row), count

    tilt, thickness = surface.tilt, FIRST_THICKNESS
    observed = observed_under(tilt, thickness)
    if len(observed.places.row) < MIN_OBSERVED * len(searched):
        return None
    if observed.excess(PROBED_PERIODS).by_chance > SMOOTH_BY_CHANCE:
        return None
    periods, agreement = observed.likely_periods(PERIODS)
    if agreement < MIN_FIRST_AGREEMENT:
        return None
    (tilt, thickness), periods = _refined(fits, (tilt, thickness), periods)
    observed = observed_under(tilt, thickness)
    repeated, by_chance, _ = observed.excess(periods)
    is_smooth = by_chance > MAX_BY_CHANCE or not exceeds_chance(repeated, by_chance, 1.0)
    if is_smooth or repeated < MIN_REPEATED or observed.amplitude(periods) < MIN_AMPLITUDE_DEG:
        return None
    return Relief(surface.tilted(mask, tilt), thickness * radius, periods, repeated - by_chance, x, y, shown)


def _refined(
    fits: Callable[[float, float, range], tuple[float, int]], place: tuple[float, float], periods: int
) -> tuple[tuple[float, float], int]:
    """Return the tilt and thickness near a place that fit best, and their number of periods.

    A coordinate search, with steps that are halved where no neighbour is better.
    """
    fit, _ = fits(*place, range(periods, periods + 1))
    turn, step = np.radians(FIRST_TURN_DEG), FIRST_THICKNESS
    while turn > np.radians(FINAL_TURN_DEG):
        # A relief that lies deeper has fewer periods in the same width.
        counts = range(max(periods - 1, PERIODS[0]), min(periods + 1, PERIODS[-1]) + 1)
        tilt, thickness = place
        neighbours = [(tilt - turn, thickness), (tilt + turn, thickness)]
        neighbours += [(tilt, thickness - step), (tilt, thickness + step)]
        (best, count), neighbour = max((fits(*neighbour, counts), neighbour) for neighbour in neighbours)
        if best > fit:
            fit, periods, place = best, count, neighbour
        else:
            turn, step = turn / 2.0, step / 2.0
    return place, periods
