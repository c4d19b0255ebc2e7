"""The pattern that a near light leaves on a matte table, and the light's inverse distance that explains it.

A near light brightens the side of the background above which it stands: irradiance falls off with the square of the
distance and the cosine of incidence. Relative to one place and one frame, the logarithm of a place's level depends
neither on the cloth's albedo nor on the exposure, nor on the light's brightness, so the pattern that remains shows the
inverse distance (near point lights: Papadhimitri and Favaro 2014). A codec, which holds levels back, weakens that
pattern (`held_levels`); its slack is fitted together with the inverse distance.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.near_light.held_levels import held_back
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.table_plane import TablePlane

MIN_PLACES = 60
"""Places of the background from which the pattern is trusted."""
OUTLIER_DEVIATIONS = 4.0
"""Robust standard deviations beyond which a place is taken to lie in a shadow or a caustic."""
ROUNDING_DEVIATION = 12.0**-0.5
"""Least such deviation, in levels: that of rounding. On a plain table most levels can be equal, and the pattern is in
those that are not."""
ITERATIONS = 5
"""Times that the inverse distance is improved."""
START_REACHES = 0.02
"""Inverse distance from which the iteration starts, times the distance of the farthest place; it must not be 0."""
MEDIAN_ROUNDS = 3
"""Times that the medians of frames and places are taken out in turn."""
FOLDS = 8
"""Groups of consecutive frames of which each is left out in turn."""
SLACKS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
"""Slacks of a codec that are tried, in levels."""
DISTANCE_TOLERANCE = 0.01
"""Inverse distance to which each fit with a slack is exact, times the distance of the farthest place."""
MIN_SIGNIFICANCE = 5.0
"""Standard errors by which the inverse distance must exceed zero."""


@dataclass(frozen=True, slots=True)
class PatternFit:
    """Inverse distance of the light that explains a pattern, 1/pixels, and its standard error."""

    inverse_distance: float
    standard_error: float

    @property
    def is_significant(self) -> bool:
        """Whether the light is near beyond doubt."""
        return self.inverse_distance > max(0.0, MIN_SIGNIFICANCE * self.standard_error)


@dataclass(frozen=True, slots=True)
class Background:
    """N places of the background in T frames.

    logarithms: (T, N), of the levels.
    used: (T, N) bool, which of them count.
    points: (N, 3), of the places, pixels from the reference point, y up.
    table: their plane.
    site: the sphere that shows the light's directions in these frames.
    room_share, room_deviation: share of the room's light in a usual level, and its standard deviation.
    """

    logarithms: np.ndarray
    used: np.ndarray
    points: np.ndarray
    table: TablePlane
    site: SphereLights
    room_share: float
    room_deviation: float

    def part(self, frames: np.ndarray) -> "Background":
        """Return the part of frames (T,) bool."""
        return replace(
            self,
            logarithms=self.logarithms[frames],
            used=self.used[frames],
            site=SphereLights(self.site.lights[frames], self.site.positions[frames]),
        )

    def without_outliers(self) -> "Background":
        """Return the background without what lies in a shadow or a caustic."""
        pattern = _without_medians(self.logarithms, self.used)
        least = ROUNDING_DEVIATION / self.usual_level
        limit = OUTLIER_DEVIATIONS * max(robust_deviation(pattern[np.isfinite(pattern)]), least)
        return replace(self, used=np.abs(np.nan_to_num(pattern, nan=np.inf)) < limit)

    @property
    def usual_level(self) -> float:
        """Median level of the background."""
        return float(np.exp(np.median(self.logarithms)))

    def inverse_distance_of(self, levels: float) -> float:
        """Return the inverse distance, 1/pixels, of a light whose pattern is so many levels (RMS)."""
        near = START_REACHES / self._reach
        strength = float(np.sqrt(np.nanmean(self._model(near) ** 2)))
        return levels * near / (strength * self.usual_level)

    def fit(self) -> PatternFit:
        """Fit the light's inverse distance."""
        least = START_REACHES / self._reach
        inverse = self._inverse(least, ITERATIONS)
        start = max(inverse, least)

        def again(kept: np.ndarray) -> float:
            return self.part(kept)._inverse(start, 1)

        return PatternFit(inverse, standard_error(len(self.used), again))

    def fit_with_slack(self) -> float:
        """Return the inverse distance, 1/pixels, of the least squares, for the slack that explains most."""
        pattern, best = _without_medians(self.logarithms, self.used), (np.inf, 0.0)
        for slack in SLACKS:

            def residual(inverse: float, slack: float = slack) -> float:
                return float(np.nanmean((self._shown_model(inverse, slack) - pattern) ** 2))

            tolerance = {"xatol": DISTANCE_TOLERANCE / self._reach}
            minimum = minimize_scalar(residual, bounds=(0.0, 1.0 / self._reach), method="bounded", options=tolerance)
            if minimum.fun >= best[0]:
                break
            best = float(minimum.fun), float(minimum.x)
        return best[1]

    @property
    def _reach(self) -> float:
        """Distance of the farthest place, pixels."""
        return float(np.linalg.norm(self.points, axis=1).max())

    def _model(self, inverse: float) -> np.ndarray:
        """Return the pattern (T, N) of a light at an inverse distance."""
        return _without_medians(self._log_levels(inverse), self.used)

    def _shown_model(self, inverse: float, slack: float) -> np.ndarray:
        """Return the pattern (T, N) of a light at an inverse distance as a codec with a slack shows it."""
        model = self._log_levels(inverse)
        for axis in (1, 0):
            model = model - np.median(model - self.logarithms, axis=axis, keepdims=True)
        return _without_medians(np.log(held_back(np.exp(model), slack)), self.used)

    def _log_levels(self, inverse: float) -> np.ndarray:
        """Return the logarithm (T, N) of levels, up to a term of each frame and place, of a light at an inverse
        distance."""
        directions = self.site.at_reference(np.full(len(self.used), inverse))
        return self.table.log_levels(self.points, directions, inverse, self.room_share)

    def _inverse(self, start: float, iterations: int) -> float:
        """Return the inverse distance, 1/pixels, that explains the pattern, from an approximate one, `start`."""
        pattern, reach = _without_medians(self.logarithms, self.used), self._reach
        inverse = start
        for _ in range(iterations):
            near = max(inverse, START_REACHES / reach)
            model = self._model(near)
            inside = np.isfinite(model) & np.isfinite(pattern)
            scale = float((model[inside] @ pattern[inside]) / (model[inside] @ model[inside]))
            # A light between the background and the object would have been in the picture.
            inverse = float(np.clip(near * scale, -1.0 / reach, 1.0 / reach))
        return inverse


def standard_error(count: int, value: Callable[[np.ndarray], float]) -> float:
    """Return the standard error of what `count` frames give, by the jackknife over groups of consecutive ones.

    value(kept): what the frames kept (T,) bool give.
    """
    groups = np.arange(count) * FOLDS // count
    return float(np.sqrt(FOLDS - 1.0) * np.std([value(groups != fold) for fold in range(FOLDS)]))


def _without_medians(values: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return values (T, N) without the median of each frame and of each place over what is used (T, N) bool; else NaN.

    Shadows lie opposite to the light, where falloff darkens as well: means would take them for it.
    """
    values = np.where(used, values, np.nan)
    for _ in range(MEDIAN_ROUNDS):
        values = values - _medians(values)[:, None]
        values = values - _medians(values.T)
    return values


def _medians(values: np.ndarray) -> np.ndarray:
    """Return the median of each row of values (T, N) that is not NaN, NaN where there is none; np.nanmedian is slow."""
    ordered, count = np.sort(values, axis=1), (~np.isnan(values)).sum(axis=1)
    middles = np.maximum(np.stack([(count - 1) // 2, count // 2], axis=1), 0)
    return np.asarray(np.take_along_axis(ordered, middles, axis=1).mean(axis=1))
