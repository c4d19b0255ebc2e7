"""Distance of a near light from the brightness of the matte background, where a single sphere shows its direction.

A near light brightens the side of the background above which it stands: irradiance falls off with the square of the
distance and the cosine of incidence. The background is the plane of the table, at any angle to the camera
(`table_plane`). Relative to one place and one frame, the logarithm of a place's level depends neither on the cloth's
albedo nor on the exposure, nor on the light's brightness, so the pattern that remains shows the inverse distance (near
point lights: Papadhimitri and Favaro 2014). Light of the room weakens the pattern; how much there is shows in the
darkest shadow, or in how the background follows the light's cosine. A codec holds a block's level until it has changed
by a few levels, which weakens the pattern too: levels count where they have just changed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.table_plane import CAMERA_EXPONENT, TablePlane, shadow_share, table_normal

MIN_LIT_FRAMES, MIN_PLACES = 40, 60
"""Frames and places of the background from which the pattern is trusted."""
MIN_LIGHT_COSINE = 0.25
"""Cosine of the light's incidence below which the background is lit at a grazing angle, and shadows cover it."""
MIN_LIGHT_DEVIATION = 0.03
"""Standard deviation of the light's directions from their mean below which they change too little to show a pattern."""
MIN_LEVEL, MAX_LEVEL = 8.0, 250.0
"""Levels, of 255, between which the background is neither noise nor clipped."""
MAX_LEVEL_PERCENTILE = 95.0
"""Percentile over the frames of a place's level that must not be clipped; in the rest it may be."""
MAX_ROOM_SHARE = 0.65
"""Share of the room's light in the background's beyond which the light's pattern is not trusted."""
ROOM_DEVIATIONS = 2.0
"""Standard errors by which the room may have more light than the cosine shows."""
OUTLIER_DEVIATIONS = 4.0
"""Robust standard deviations beyond which a place is taken to lie in a shadow or a caustic."""
LEAST_CHANGES = 2.0, 1.0
"""Changes of a level since the frame before, in levels, from which it is known to be coded anew, the best first: the
larger, the less of it is lost (`python -m tests.benchmarks.light_distance`)."""
MIN_CHANGED_FRAMES, MIN_FRAME_PLACES, MIN_PLACE_FRAMES = 24, 8, 5
"""Frames in which levels change from which these alone are used, and changes of a frame and of a place from which their
medians are known."""
MAX_PLACES = 400
"""Places, spread over the background, that are used: more do not help."""
PLANE_ROUNDS, ITERATIONS = 2, 5
"""Times that the table's plane is measured, with the light's distance in between, and that this is improved."""
START_REACHES = 0.02
"""Inverse distance from which the iteration starts, in those of the farthest place: it must not be 0."""
SWEEPS = 3
"""Times that the medians of frames and places are taken out in turn."""
FOLDS = 8
"""Groups of consecutive frames of which each is left out in turn."""
EXPONENT_ERROR, ROOM_ERROR = 0.2, 0.1
"""Standard deviations of the camera's exponent, relative (with the light's beam: that of sRGB is a fifth larger at dark
levels), and of the room's share by shadows that are not wholly dark."""
MIN_SIGNIFICANCE = 5.0
"""Standard errors by which the inverse distance must exceed zero."""


@dataclass(frozen=True, slots=True)
class Falloff:
    """inverse_distance: of the light from the reference point, 1/pixels, 0 for a distant one; standard_deviation: of
    it, by scatter and model together."""

    inverse_distance: float
    standard_deviation: float


def measure_falloff(
    levels: np.ndarray, x: np.ndarray, y: np.ndarray, site: SphereLights, centre: np.ndarray, radius: float
) -> Falloff | None:
    """Measure a light's inverse distance by the background; None where that does not show it.

    Args:
        levels: (T, N) of N places of the background, 0 to 255.
        x, y: (N,) of the places relative to the reference point, pixels, y up.
        site: of the sphere that shows the light's directions in these frames, relative to the same point.
        centre: (3,) of that sphere, likewise; radius: of it, pixels.
    """
    middle = np.median(levels, axis=0)
    places = (middle > MIN_LEVEL) & (np.percentile(levels, MAX_LEVEL_PERCENTILE, axis=0) < MAX_LEVEL)
    lit = np.isfinite(site.lights[:, 0])
    if lit.sum() < MIN_LIT_FRAMES or places.sum() < MIN_PLACES:
        return None
    if np.linalg.norm(site.lights[lit].std(axis=0)) < MIN_LIGHT_DEVIATION:
        return None
    places = np.flatnonzero(places)[:: -(-int(places.sum()) // MAX_PLACES)]
    shown = np.maximum(levels[:, places].astype(np.float32), 1.0)
    inverse = 0.0
    for _ in range(PLANE_ROUNDS):
        lights = site.at_reference(np.full(len(site.lights), inverse))
        table = TablePlane.below(table_normal(shown[lit], lights[lit]), centre, radius)
        cosines = np.nan_to_num(lights) @ table.normal
        frames = lit & (cosines > MIN_LIGHT_COSINE)
        if frames.sum() < MIN_LIT_FRAMES:
            return None
        logarithms = np.log(shown[frames])
        room_share, room_sd = _room_share(shown, logarithms, cosines[frames])
        if room_share > MAX_ROOM_SHARE:
            return None
        background = _Background(
            logarithms,
            np.ones(logarithms.shape, bool),
            table.points(x[places], y[places]),
            table,
            SphereLights(site.lights[frames], site.positions[frames]),
            room_share,
        )
        whole = background.without_outliers().fit()
        if not whole.is_significant:
            return Falloff(0.0, float(np.hypot(whole.error, max(whole.inverse, 0.0))))
        inverse = whole.inverse
    # Moving shadows and caustics change levels most: whether a light is near at all is not told by changes alone.
    changes = np.abs(np.diff(shown, axis=0, prepend=np.nan))[frames]
    parts = [background.of_changes(changes >= least) for least in LEAST_CHANGES]
    fits = [part.without_outliers().fit() for part in parts if part is not None]
    fit = next((fit for fit in fits if fit.is_significant), whole)
    # What a codec weakened among all levels may still be weakened as much among those that changed.
    held = fit.inverse - whole.inverse
    model = fit.inverse * np.hypot(EXPONENT_ERROR, np.hypot(ROOM_ERROR, room_sd) / (1.0 - room_share))
    return Falloff(fit.inverse, float(np.sqrt(fit.error**2 + model**2 + held**2)))


@dataclass(frozen=True, slots=True)
class _Fit:
    """inverse: distance of the light, 1/pixels; error: standard error of it."""

    inverse: float
    error: float

    @property
    def is_significant(self) -> bool:
        """Whether the light is near beyond doubt."""
        return self.inverse >= MIN_SIGNIFICANCE * self.error


@dataclass(frozen=True, slots=True)
class _Background:
    """The background under a light.

    logarithms: of the levels, (T, N), and which of them are used, (T, N) bool; points: of the places, (N, 3); table:
    their plane; site: of the sphere that shows the light's directions in these frames; room_share: of the
    room's light in a usual level.
    """

    logarithms: np.ndarray
    used: np.ndarray
    points: np.ndarray
    table: TablePlane
    site: SphereLights
    room_share: float

    def part(self, frames: np.ndarray, places: np.ndarray) -> "_Background":
        """Return the part of frames (T,) bool and places (N,) bool."""
        chosen, site = np.ix_(frames, places), SphereLights(self.site.lights[frames], self.site.positions[frames])
        return replace(
            self, logarithms=self.logarithms[chosen], used=self.used[chosen], points=self.points[places], site=site
        )

    def of_changes(self, changed: np.ndarray) -> "_Background | None":
        """Return the part whose levels have changed (T, N) bool, None where it is too small."""
        used = changed & (changed.sum(axis=1) >= MIN_FRAME_PLACES)[:, None]
        places = used.sum(axis=0) >= MIN_PLACE_FRAMES
        frames = used[:, places].any(axis=1)
        if frames.sum() < MIN_CHANGED_FRAMES or places.sum() < MIN_PLACES:
            return None
        return replace(self, used=used).part(frames, places)

    def without_outliers(self) -> "_Background":
        """Return the background without what lies in a shadow or a caustic."""
        pattern = _without_medians(self.logarithms, self.used)
        limit = OUTLIER_DEVIATIONS * (robust_deviation(pattern[np.isfinite(pattern)]) + 1e-6)
        return replace(self, used=np.abs(np.nan_to_num(pattern, nan=np.inf)) < limit)

    def fit(self) -> _Fit:
        """Fit the light's inverse distance."""
        reach = float(np.linalg.norm(self.points, axis=1).max())
        inverse = self._inverse(START_REACHES / reach, reach, ITERATIONS)
        start, everywhere = max(inverse, START_REACHES / reach), np.ones(len(self.points), bool)

        def again(kept: np.ndarray) -> float:
            return self.part(kept, everywhere)._inverse(start, reach, 1)

        return _Fit(inverse, _standard_error(len(self.used), again))

    def _inverse(self, start: float, reach: float, iterations: int) -> float:
        """Return the inverse distance that explains the pattern, from an approximate one, `start`.

        reach: of the farthest place, pixels.
        """
        pattern = _without_medians(self.logarithms, self.used)
        inverse = start
        for _ in range(iterations):
            near = max(inverse, START_REACHES / reach)
            directions = self.site.at_reference(np.full(len(self.used), near))
            model = self.table.log_levels(self.points, directions, near, self.room_share)
            model = _without_medians(model, self.used)
            inside = np.isfinite(model) & np.isfinite(pattern)
            scale = float((model[inside] @ pattern[inside]) / (model[inside] @ model[inside]))
            # A light between the background and the object would have been in the picture.
            inverse = float(np.clip(near * scale, -1.0 / reach, 1.0 / reach))
        return inverse


def _room_share(levels: np.ndarray, logarithms: np.ndarray, cosines: np.ndarray) -> tuple[float, float]:
    """Return the share of the room's light in the background's, the least that shadows or the cosine show, and its
    standard deviation, 0 by shadows.

    levels (T, N) of all frames; logarithms (T', N) of those of the frames that are used; cosines (T',) of the light's
    incidence in these.
    """
    in_shadow = shadow_share(levels)
    cosine, brightness = np.log(cosines.astype(np.float64)), np.median(logarithms, axis=1)

    def room(kept: np.ndarray) -> float:
        return 1.0 - float(np.polyfit(cosine[kept], brightness[kept], 1)[0]) / CAMERA_EXPONENT

    error = _standard_error(len(cosine), room)
    # A drift of the exposure can look like the cosine, and hide the room's light.
    by_cosine = max(room(np.ones(len(cosine), bool)) + ROOM_DEVIATIONS * error, 0.0)
    return (in_shadow, 0.0) if in_shadow < by_cosine else (by_cosine, error)


def _standard_error(count: int, value: Callable[[np.ndarray], float]) -> float:
    """Return the standard error of what `count` frames give, by leaving out groups of consecutive ones (jackknife).

    value(kept): what the frames kept (T,) bool give.
    """
    groups = np.arange(count) * FOLDS // count
    return float(np.sqrt(FOLDS - 1.0) * np.std([value(groups != fold) for fold in range(FOLDS)]))


def _without_medians(values: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return values (T, N) without the median of each frame and of each place over what is used (T, N) bool; else NaN.

    Shadows lie opposite to the light, where falloff darkens as well: means would take them for it.
    """
    values = np.where(used, values, np.nan)
    for _ in range(SWEEPS):
        values = values - _medians(values)[:, None]
        values = values - _medians(values.T)
    return values


def _medians(values: np.ndarray) -> np.ndarray:
    """Return the median of each row of values (T, N) that is not NaN, NaN where there is none; np.nanmedian is slow."""
    ordered, count = np.sort(values, axis=1), (~np.isnan(values)).sum(axis=1)
    middles = np.maximum(np.stack([(count - 1) // 2, count // 2], axis=1), 0)
    return np.asarray(np.take_along_axis(ordered, middles, axis=1).mean(axis=1))
