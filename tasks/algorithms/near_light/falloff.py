"""Distance of a near light from the brightness of the matte background, where a single sphere shows its direction.

A near light brightens the side of the background above which it stands: irradiance falls off with the square of the
distance and the cosine of incidence. Relative to one place and one frame, the logarithm of a place's level depends
neither on the cloth's albedo nor on the exposure, nor on the light's brightness, so the pattern that remains shows the
inverse distance (near point lights: Papadhimitri and Favaro 2014). Light of the room weakens the pattern; how much
there is shows in the darkest shadow, or in how the background follows the light's cosine.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.near_light.positions import SphereLights

CAMERA_EXPONENT = 1.0 / 2.2
"""Exponent of a usual camera's levels over irradiance."""
MIN_LIT_FRAMES, MIN_PLACES = 40, 60
"""Frames and places of the background from which the pattern is trusted."""
MIN_LIGHT_NZ = 0.25
"""Light's z below which the background is lit at a grazing angle, and shadows cover it."""
MIN_LIGHT_DEVIATION = 0.03
"""Standard deviation of the light's directions from their mean below which they change too little to show a pattern."""
MIN_LEVEL, MAX_LEVEL = 8.0, 250.0
"""Levels, of 255, between which the background is neither noise nor clipped."""
MAX_LEVEL_PERCENTILE = 95.0
"""Percentile over the frames of a place's level that must not be clipped; in the rest it may be."""
MAX_ROOM_SHARE = 0.65
"""Share of the room's light in the background's beyond which the light's pattern is not trusted."""
SHADOW_PERCENTILE, SHADOWED_PLACES_PERCENTILE = 1.0, 2.0
"""Percentile over the frames of a place's level in shadow, and over the places: the darkest shadow, without noise."""
OUTLIER_DEVIATIONS = 4.0
"""Robust standard deviations beyond which a place is taken to lie in a shadow or a caustic."""
MAX_PLACES = 400
"""Places, spread over the background, that are used: more do not help."""
ITERATIONS = 5
START_REACHES = 0.02
"""Inverse distance from which the iteration starts, in those of the farthest place: it must not be 0."""
MIN_INCIDENCE = 0.02
"""Least cosine of the incidence in the model: at less the background is not lit."""
SWEEPS = 3
"""Times that the medians of frames and places are taken out in turn."""
FOLDS = 8
"""Groups of consecutive frames; leaving each out in turn gives the standard error (jackknife)."""
MODEL_ERROR = 0.25
"""Relative standard deviation of the inverse distance in a dark room, since the camera's exponent and the light's beam
are unknown; the room's light, whose share is uncertain, enlarges it."""
MIN_SIGNIFICANCE = 5.0
"""Standard errors by which the inverse distance must exceed zero."""


@dataclass(frozen=True, slots=True)
class Falloff:
    """inverse_distance: of the light from the reference point, 1/pixels, 0 for a distant one; standard_deviation: of
    it, by scatter and model together."""

    inverse_distance: float
    standard_deviation: float


def measure_falloff(levels: np.ndarray, x: np.ndarray, y: np.ndarray, site: SphereLights) -> Falloff | None:
    """Measure a light's inverse distance by the background; None where that does not show it.

    Args:
        levels: (T, N) of N places of the background, 0 to 255.
        x, y: (N,) of the places relative to the reference point, pixels, y up.
        site: of the sphere that shows the light's directions in these frames, relative to the same point.
    """
    lights = site.lights
    middle = np.median(levels, axis=0)
    places = (middle > MIN_LEVEL) & (np.percentile(levels, MAX_LEVEL_PERCENTILE, axis=0) < MAX_LEVEL)
    frames = np.isfinite(lights[:, 0]) & (np.nan_to_num(lights[:, 2]) > MIN_LIGHT_NZ)
    if frames.sum() < MIN_LIT_FRAMES or places.sum() < MIN_PLACES:
        return None
    if np.linalg.norm(lights[frames].std(axis=0)) < MIN_LIGHT_DEVIATION:
        return None
    places = np.flatnonzero(places)[:: -(-int(places.sum()) // MAX_PLACES)]
    logarithms = np.log(np.maximum(levels[:, places], 1.0))
    light_share = 1.0 - _room_share(levels[:, places], logarithms, lights, frames)
    if light_share < 1.0 - MAX_ROOM_SHARE:
        return None
    response = CAMERA_EXPONENT * light_share
    points = np.stack([x[places], y[places], np.zeros(len(places))], axis=-1)
    observed, site = logarithms[frames], SphereLights(lights[frames], site.positions[frames])
    pattern = _without_medians(observed, np.ones(observed.shape, bool))
    deviation = robust_deviation(pattern) + 1e-6
    used = np.abs(pattern) < OUTLIER_DEVIATIONS * deviation
    pattern = _without_medians(observed, used)
    reach = float(np.linalg.norm(points, axis=1).max())

    start = START_REACHES / reach

    def fit(kept: np.ndarray, inverse: float, iterations: int) -> float:
        """Return the inverse distance that explains the pattern of frames (T,), from an approximate one."""
        for _ in range(iterations):
            near = np.full(np.count_nonzero(kept), max(inverse, start))
            directions = SphereLights(site.lights[kept], site.positions[kept]).at_reference(near)
            model = response * _log_irradiance(directions, max(inverse, start), points)
            model = _without_medians(model, used[kept])
            inside = np.isfinite(model) & np.isfinite(pattern[kept])
            scale = float((model[inside] @ pattern[kept][inside]) / (model[inside] @ model[inside]))
            # A light between the background and the object would have been in the picture.
            inverse = float(np.clip(max(inverse, start) * scale, -1.0 / reach, 1.0 / reach))
        return inverse

    all_frames = np.ones(len(observed), bool)
    groups = np.arange(len(observed)) * FOLDS // len(observed)
    inverse = fit(all_frames, start, ITERATIONS)
    error = np.sqrt(FOLDS - 1.0) * float(np.std([fit(groups != fold, inverse, 1) for fold in range(FOLDS)]))
    if inverse < MIN_SIGNIFICANCE * error:
        return Falloff(0.0, float(np.hypot(error, max(inverse, 0.0))))
    return Falloff(inverse, float(np.hypot(error, MODEL_ERROR / light_share * inverse)))


def _room_share(levels: np.ndarray, logarithms: np.ndarray, lights: np.ndarray, frames: np.ndarray) -> float:
    """Return the share of the room's light in the background's, the least that shadows or the cosine show.

    levels, logarithms: (T, N); lights (T, 3) of the frames (T,) that are used.
    """
    dark = np.percentile(levels, SHADOW_PERCENTILE, axis=0) / np.median(levels, axis=0)
    in_shadow = float(np.percentile(dark, SHADOWED_PLACES_PERCENTILE)) ** (1.0 / CAMERA_EXPONENT)
    cosine = np.log(lights[frames, 2].astype(np.float64))
    slope = float(np.polyfit(cosine, np.median(logarithms[frames], axis=1), 1)[0])
    return min(in_shadow, max(1.0 - slope / CAMERA_EXPONENT, 0.0))


def _log_irradiance(lights: np.ndarray, inverse_distance: float, points: np.ndarray) -> np.ndarray:
    """Return the logarithm (T, N) of the irradiance at points (N, 3) of the background, up to a term of each frame.

    lights (T, 3): directions at the reference point. The background faces the camera.
    """
    to_light = lights[:, None] - inverse_distance * points
    length = np.linalg.norm(to_light, axis=-1)
    return np.asarray(np.log(np.maximum(unit(to_light)[..., 2], MIN_INCIDENCE)) - 2.0 * np.log(length))


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
