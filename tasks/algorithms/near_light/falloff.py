"""Distance of a near light from the brightness of the matte background, where a single sphere shows its direction.

The background is the plane of the table, at any angle to the camera (`table_plane`). The pattern that falloff leaves on
it shows the light's inverse distance (`background_pattern`). Light of the room weakens the pattern; how much there is
shows in the darkest shadow, or in how the background follows the light's cosine. A codec that holds levels back weakens
the pattern too, or leaves none: its slack is fitted, and how far levels are held back bounds what they can show.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.near_light.background_pattern import MIN_PLACES, Background, PatternFit, standard_error
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.table_plane import CAMERA_EXPONENT, TablePlane, shadow_share, table_normal

MIN_LIT_FRAMES = 40
"""Frames from which the pattern is trusted."""
MIN_LIGHT_COSINE = 0.25
"""Cosine of the light's incidence below which the background is lit at a grazing angle, and shadows cover it."""
MIN_LIGHT_DEVIATION = 0.03
"""Standard deviation of the light's directions from their mean below which they change too little to show a pattern."""
MIN_LEVEL, MAX_LEVEL = 8.0, 250.0
"""Levels, of 255, between which the background is neither noise nor clipped."""
MAX_LEVEL_PERCENTILE = 95.0
"""Percentile over the frames of a place's level that must not be clipped; in the rest it may be."""
MAX_PLACES = 400
"""Places, spread over the background, that are used: more do not help."""
MAX_ROOM_SHARE = 0.7
"""Share of the room's light in the background's beyond which the light's pattern is not trusted."""
ROOM_DEVIATIONS = 2.0
"""Standard errors by which the room may have more light than the cosine shows."""
PLANE_ROUNDS = 2
"""Times that the table's plane is measured, with the light's distance in between."""
HELD_DEVIATION = 3.0**-0.5
"""Standard deviation of an error that lies anywhere within what a level is held back, relative to that."""
SLACK_ERROR, EXPONENT_ERROR, ROOM_ERROR = 0.5, 0.2, 0.06
"""Standard deviations of what the slack of a codec adds, relative, since blocks differ in it; of the camera's exponent,
relative (with the light's beam: that of sRGB is a fifth larger at dark levels); and of the room's share by shadows
(`python -m tests.benchmarks.table_lights`)."""


@dataclass(frozen=True, slots=True)
class Falloff:
    """Distance of a light as the background shows it.

    inverse_distance: of the light from the reference point, 1/pixels, 0 for a distant one. standard_deviation: of the
    inverse distance, by scatter and model together.
    """

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
    table = _Table(shown, x[places], y[places], site, centre, radius)
    inverse, held = 0.0, _held_levels(shown[lit])
    for _ in range(PLANE_ROUNDS):
        measured = table.background(inverse)
        if measured is None:
            return None
        background = measured.without_outliers()
        fit = background.fit()
        hidden = measured.inverse_distance_of(HELD_DEVIATION * held)
        if not fit.is_significant:
            known = np.hypot(fit.standard_error, max(fit.inverse_distance, 0.0))
            return Falloff(0.0, float(np.hypot(known, hidden)))
        inverse = fit.inverse_distance
    return _near_falloff(background, fit, hidden)


@dataclass(frozen=True, slots=True)
class _Table:
    """What a camera sees of the table; levels (T, N) float32, 1 to 255, for the rest see `measure_falloff`."""

    levels: np.ndarray
    x: np.ndarray
    y: np.ndarray
    site: SphereLights
    centre: np.ndarray
    radius: float

    def background(self, inverse: float) -> Background | None:
        """Return the background in the frames whose light reaches the table well, the table's plane and the room's
        light measured under a light of this inverse distance; None where there is too little light."""
        lights = self.site.at_reference(np.full(len(self.site.lights), inverse))
        lit = np.isfinite(self.site.lights[:, 0])
        plane = TablePlane.below(table_normal(self.levels[lit], lights[lit]), self.centre, self.radius)
        cosines = np.nan_to_num(lights) @ plane.normal
        frames = lit & (cosines > MIN_LIGHT_COSINE)
        if frames.sum() < MIN_LIT_FRAMES:
            return None
        logarithms = np.log(self.levels[frames])
        # Frames whose light the sphere does not show may show the table by the room's light alone: they count here.
        room_share, room_deviation = _room_share(shadow_share(self.levels), logarithms, cosines[frames])
        if room_share > MAX_ROOM_SHARE:
            return None
        return Background(
            logarithms,
            np.ones(logarithms.shape, bool),
            plane.points(self.x, self.y),
            plane,
            SphereLights(self.site.lights[frames], self.site.positions[frames]),
            room_share,
            room_deviation,
        )


def _room_share(in_shadow: float, logarithms: np.ndarray, cosines: np.ndarray) -> tuple[float, float]:
    """Return the share of the room's light in the background's, the least that shadows or the cosine show, and its
    standard deviation, 0 by shadows.

    in_shadow: the share that the darkest shadow leaves possible; logarithms (T, N) of the levels; cosines (T,) of the
    light's incidence.
    """
    cosine, brightness = np.log(cosines.astype(np.float64)), np.median(logarithms, axis=1)

    def room(kept: np.ndarray) -> float:
        return 1.0 - float(np.polyfit(cosine[kept], brightness[kept], 1)[0]) / CAMERA_EXPONENT

    error = standard_error(len(cosine), room)
    # A drift of the exposure can look like the cosine, and hide the room's light.
    by_cosine = max(room(np.ones(len(cosine), bool)) + ROOM_DEVIATIONS * error, 0.0)
    return (in_shadow, 0.0) if in_shadow < by_cosine else (by_cosine, error)


def _held_levels(levels: np.ndarray) -> float:
    """Return how far a codec holds back levels (T, N) of places under a moving light, in levels.

    While a level stays as it is, the light moves on: from one change to the next by the mean change of the whole table,
    times the number of frames between them.
    """
    is_held = np.diff(levels, axis=0) == 0.0
    drift = float(np.abs(np.diff(levels.mean(axis=1))).mean())
    return drift * float(is_held.sum() / max(int((~is_held).sum()), 1))


def _near_falloff(background: Background, whole: PatternFit, hidden: float) -> Falloff:
    """Return the falloff of a near light, what a codec holds back allowed for.

    whole: the fit that does not allow for it. hidden: inverse distance whose pattern a codec may hide, 1/pixels.
    """
    inverse = background.fit_with_slack()
    room = np.hypot(ROOM_ERROR, background.room_deviation) / (1.0 - background.room_share)
    model = inverse * np.hypot(EXPONENT_ERROR, room)
    held = SLACK_ERROR * (inverse - whole.inverse_distance)
    return Falloff(inverse, float(np.sqrt(whole.standard_error**2 + model**2 + held**2 + hidden**2)))
