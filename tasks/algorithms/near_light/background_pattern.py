"""The pattern that a near light leaves on a matte table, and the light's inverse distance that explains it.

A near light brightens the side of the background above which it stands: irradiance falls off with the square of the
distance and the cosine of incidence. Relative to one place and one frame, the logarithm of a place's level depends
neither on the cloth's albedo nor on the exposure, nor on the light's brightness, so the pattern that remains shows the
inverse distance (near point lights: Papadhimitri and Favaro 2014).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.table_plane import TablePlane

MIN_PLACES = 60
"""Places of the background from which the pattern is trusted."""
OUTLIER_DEVIATIONS = 4.0
"""Robust standard deviations beyond which a place is taken to lie in a shadow or a caustic."""
ROUNDING_DEVIATION = 12.0**-0.5
"""Least such deviation, in levels: that of rounding. On a plain table most levels can be equal, and the pattern is in
those that are not."""
MIN_CHANGED_FRAMES, MIN_FRAME_PLACES, MIN_PLACE_FRAMES = 24, 8, 5
"""Least number of frames with changed levels for these alone to be used, and least numbers of changes in a frame and at
a place for their medians to be known."""
ITERATIONS = 5
"""Times that the inverse distance is improved."""
START_REACHES = 0.02
"""Inverse distance from which the iteration starts, times the distance of the farthest place; it must not be 0."""
MEDIAN_ROUNDS = 3
"""Times that the medians of frames and places are taken out in turn."""
FOLDS = 8
"""Groups of consecutive frames of which each is left out in turn."""
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
        return self.inverse_distance >= MIN_SIGNIFICANCE * self.standard_error


@dataclass(frozen=True, slots=True)
class Background:
    """N places of the background in T frames.

    logarithms: (T, N), of the levels.
    used: (T, N) bool, which of them count.
    changes: (T, N), absolute change of each level since the frame before, NaN in the first.
    points: (N, 3), of the places, pixels from the reference point, y up.
    table: their plane.
    site: the sphere that shows the light's directions in these frames.
    room_share, room_deviation: share of the room's light in a usual level, and its standard deviation.
    """

    logarithms: np.ndarray
    used: np.ndarray
    changes: np.ndarray
    points: np.ndarray
    table: TablePlane
    site: SphereLights
    room_share: float
    room_deviation: float

    def part(self, frames: np.ndarray, places: np.ndarray) -> "Background":
        """Return the part of frames (T,) bool and places (N,) bool."""
        chosen, site = np.ix_(frames, places), SphereLights(self.site.lights[frames], self.site.positions[frames])
        return replace(
            self,
            logarithms=self.logarithms[chosen],
            used=self.used[chosen],
            changes=self.changes[chosen],
            points=self.points[places],
            site=site,
        )

    def of_changes(self, least: float) -> "Background | None":
        """Return the part whose levels have changed by at least so much; None where it is too small."""
        changed = self.changes >= least
        used = changed & (changed.sum(axis=1) >= MIN_FRAME_PLACES)[:, None]
        places = used.sum(axis=0) >= MIN_PLACE_FRAMES
        frames = used[:, places].any(axis=1)
        if frames.sum() < MIN_CHANGED_FRAMES or places.sum() < MIN_PLACES:
            return None
        return replace(self, used=used).part(frames, places)

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
        least, everywhere = START_REACHES / self._reach, np.ones(len(self.points), bool)
        inverse = self._inverse(least, ITERATIONS)
        start = max(inverse, least)

        def again(kept: np.ndarray) -> float:
            return self.part(kept, everywhere)._inverse(start, 1)

        return PatternFit(inverse, standard_error(len(self.used), again))

    @property
    def _reach(self) -> float:
        """Distance of the farthest place, pixels."""
        return float(np.linalg.norm(self.points, axis=1).max())

    def _model(self, inverse: float) -> np.ndarray:
        """Return the pattern (T, N) of a light at an inverse distance."""
        directions = self.site.at_reference(np.full(len(self.used), inverse))
        model = self.table.log_levels(self.points, directions, inverse, self.room_share)
        return _without_medians(model, self.used)

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
