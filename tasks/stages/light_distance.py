"""The light's distance: given, measured by several spheres, or unknown; and what not knowing it costs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glint.storage.errors import InputError
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.lights import Lights, merge_spheres
from glint.tasks.algorithms.lighting.spheres import precision_weights
from glint.tasks.algorithms.near_light.falloff import Falloff, measure_falloff
from glint.tasks.algorithms.near_light.half_vector_error import (
    LEAST_DISTANCE_SIZES,
    PixelGrid,
    combined_error,
    depth_error,
    light_distance_error,
    unknown_distance_error,
    unknown_inverse_distance,
)
from glint.tasks.algorithms.near_light.positions import NearLight, SphereLights
from glint.tasks.algorithms.near_light.triangulation import MIN_SHARED_FRAMES, rotated, triangulate
from glint.tasks.engine.stage_inputs import CaptureResults
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry
from glint.tasks.stages.thumbnails import thumbnail_grid

GIVEN_ERROR, TRIANGULATED_ERROR = 0.1, 0.05
"""Relative standard deviation of an inverse distance that was given (a hand's distance varies) or triangulated (the
spheres' depths differ)."""

BACKGROUND = "background"
"""Source of a distance that the background shows."""
SPHERE_REACH = 1.15
"""Radius around a sphere, in radii, within which the frame does not show the background."""


@dataclass(frozen=True)
class DistanceResult:
    """The lights of a capture, corrected for their distance.

    lights: those of all spheres, seen from the reference point of a near light. near: its positions, None for a distant
    one. record: to be saved. errors: of half vectors, (H, W) radians per axis. inverse_distance_sd: standard deviation
    of the inverse distance, 1/pixels, where a single sphere shows the light and nobody gave its distance; else None.
    """

    lights: Lights
    near: NearLight | None
    record: Mapping[str, Any] | None
    errors: Sequence[np.ndarray]
    warnings: Sequence[StageWarning]
    inverse_distance_sd: float | None = None


@dataclass(frozen=True, slots=True)
class _KnownDistance:
    """Distance of a near light from the reference point.

    inverse (T,): 1/pixels. deviation: their standard deviation. source: where it comes from. rotations (S, 2): of the
    spheres, see `LightDistance`; None: 0.
    """

    inverse: np.ndarray
    deviation: float
    source: str
    rotations: np.ndarray | None = None


def measure_distance(
    by_sphere: Sequence[Lights],
    geometry: CaptureGeometry,
    thumbnails: tuple[np.ndarray, np.ndarray],
    tolerance: float,
    distance_mm: float | None,
) -> DistanceResult:
    """Merge the lights of all spheres, corrected for the parallax of a near light where its distance is known.

    Args:
        by_sphere: of `geometry.spheres`.
        geometry: of the capture.
        thumbnails: (N, h, w) of the whole frame, 0 to 255, and their frames' numbers (N,).
        tolerance: see `merge_spheres`.
        distance_mm: that the user gave.

    Raises:
        InputError: a distance is given, but no scale.
    """
    reference = reference_point(geometry)
    sites = [
        SphereLights.of(lights.half_vectors, sphere, reference, geometry.camera)
        for lights, sphere in zip(by_sphere, geometry.spheres, strict=True)
    ]
    count = len(by_sphere[0].reason)
    if distance_mm is not None:
        inverse = np.full(count, 1.0 / _in_pixels(distance_mm, geometry))
        given = _KnownDistance(inverse, GIVEN_ERROR * float(inverse[0]), "given")
        return _near(by_sphere, sites, geometry, tolerance, given)
    triangulated = triangulate(sites, precision_weights(geometry.spheres, np.ones(len(sites))))
    if triangulated is not None:
        inverse = triangulated.inverse_distance
        deviation = float(np.hypot(TRIANGULATED_ERROR * np.median(inverse), triangulated.standard_error))
        measured = _KnownDistance(inverse, deviation, "spheres", triangulated.rotations)
        return _near(by_sphere, sites, geometry, tolerance, measured)
    merged = merge_spheres(by_sphere, geometry.spheres, tolerance=tolerance)
    if np.isfinite(merged.inter_sphere_angle).sum() >= MIN_SHARED_FRAMES:
        return DistanceResult(merged, None, None, [], [])
    falloff = _falloff(sites, geometry, thumbnails)
    if falloff is None:
        return _unknown(merged, geometry)
    if falloff.inverse_distance > 0.0:
        inverse = np.full(count, falloff.inverse_distance)
        measured = _KnownDistance(inverse, falloff.standard_deviation, BACKGROUND)
        return _near(by_sphere, sites, geometry, tolerance, measured)
    error = light_distance_error(region_pixels(geometry), geometry.spheres, falloff.standard_deviation)
    return DistanceResult(merged, None, None, [error], [], falloff.standard_deviation)


def _near(
    by_sphere: Sequence[Lights],
    sites: Sequence[SphereLights],
    geometry: CaptureGeometry,
    tolerance: float,
    distance: _KnownDistance,
) -> DistanceResult:
    """Return the lights of all spheres as seen from the reference point."""
    inverse = distance.inverse
    rotations = np.zeros((len(by_sphere), 2)) if distance.rotations is None else distance.rotations
    moved = [
        _seen_from_reference(lights, site, inverse, rotation)
        for lights, site, rotation in zip(by_sphere, sites, rotations, strict=True)
    ]
    merged = merge_spheres(moved, geometry.spheres, tolerance=tolerance)
    near = NearLight(*reference_point(geometry), merged.half_vectors, inverse.astype(np.float32))
    least, middle, greatest = (1.0 / np.percentile(inverse, (95.0, 50.0, 5.0))).tolist()
    record = {
        "x": near.x,
        "y": near.y,
        "distance": middle,
        "least": least,
        "greatest": greatest,
        "relative_error": float(distance.deviation * middle),
        "source": distance.source,
    }
    pixels = region_pixels(geometry)
    errors = [light_distance_error(pixels, geometry.spheres, distance.deviation), depth_error(pixels, 1.0 / middle)]
    sd = distance.deviation if distance.source == BACKGROUND else None
    return DistanceResult(merged, near, record, errors, _near_warnings(geometry, errors, middle, distance.source), sd)


def _near_warnings(
    geometry: CaptureGeometry, errors: Sequence[np.ndarray], distance: float, source: str
) -> list[StageWarning]:
    """Warn of a light that is nearer than recommended and whose distance two spheres did not measure."""
    sizes = distance / max(geometry.region.width, geometry.region.height)
    if source != BACKGROUND or sizes > LEAST_DISTANCE_SIZES:
        return []
    message = (
        f"the background shows that the light was near, some {sizes:.1f} times the region's size away: half vectors are"
        " corrected for it, but two spheres would measure it three times as well; use two, or give its distance in"
        " millimetres, `parameters: {lights: {distance: ..}}`"
    )
    return [StageWarning(message, "light", _cost_deg(errors))]


def _unknown(merged: Lights, geometry: CaptureGeometry) -> DistanceResult:
    """Return the lights as if they were distant, in doubt by the least distance that is recommended."""
    pixels = region_pixels(geometry)
    errors = [unknown_distance_error(pixels, geometry.spheres)]
    message = (
        "nothing shows how far away the light was: a single sphere cannot, and the background does not follow the"
        " light. Use two spheres, one on either side, or give its distance in millimetres,"
        " `parameters: {lights: {distance: ..}}`"
    )
    warnings = [StageWarning(message, "light", _cost_deg(errors))]
    return DistanceResult(merged, None, None, errors, warnings, unknown_inverse_distance(pixels))


def _cost_deg(errors: Sequence[np.ndarray]) -> float:
    """Return the usual size, in degrees, of errors (H, W) per axis."""
    return float(np.degrees(np.sqrt(2.0) * np.median(combined_error(errors))))


def _falloff(
    sites: Sequence[SphereLights], geometry: CaptureGeometry, thumbnails: tuple[np.ndarray, np.ndarray]
) -> Falloff | None:
    """Measure the light's distance by the background, with the directions of the sphere that shows the most."""
    number = int(np.argmax([np.isfinite(site.lights[:, 0]).sum() for site in sites]))
    pictures, frames = thumbnails
    columns, rows = thumbnail_grid(pictures.shape[1:], geometry.frame_size)
    region, margin = geometry.region, geometry.frame_size[0] / pictures.shape[2]
    background = ~(
        (columns > region.x - margin)
        & (columns < region.x + region.width + margin)
        & (rows > region.y - margin)
        & (rows < region.y + region.height + margin)
    )
    for sphere in geometry.spheres:
        background &= np.hypot(columns - sphere.x, rows - sphere.y) > SPHERE_REACH * sphere.radius + margin
    x, y = reference_point(geometry)
    site = SphereLights(sites[number].lights[frames], sites[number].positions[frames])
    sphere = geometry.spheres[number]
    centre = np.array([sphere.x - x, y - sphere.y, 0.0])
    return measure_falloff(
        pictures[:, background], columns[background] - x, y - rows[background], site, centre, sphere.radius
    )


def load_near_light(results: CaptureResults) -> NearLight | None:
    """Load the near light that was measured or given; None: far away."""
    saved = results.load("lights")
    about = saved.record["near_light"]
    return (
        None
        if about is None
        else NearLight(about["x"], about["y"], saved.read("half_vectors"), saved.read("inverse_distance"))
    )


def reference_point(geometry: CaptureGeometry) -> tuple[float, float]:
    """Return x and y of the region's middle, in pixels of the full frame."""
    region = geometry.region
    return region.x + (region.width - 1) / 2, region.y + (region.height - 1) / 2


def region_pixels(geometry: CaptureGeometry) -> PixelGrid:
    """Return the pixels of the region."""
    region = geometry.region
    return PixelGrid.of(region.x, region.y, region.width, region.height)


def _seen_from_reference(
    lights: Lights, site: SphereLights, inverse_distance: np.ndarray, rotation: np.ndarray
) -> Lights:
    """Return the lights of one sphere as they are seen from the reference point."""
    corrected = replace(site, lights=rotated(site.lights, rotation)).at_reference(inverse_distance)
    half_vectors = half_vectors_of(corrected).astype(np.float32)
    return replace(lights, half_vectors=half_vectors, lights=corrected.astype(np.float32))


def _in_pixels(distance_mm: float, geometry: CaptureGeometry) -> float:
    if geometry.pixel_size is None:
        raise InputError(
            "the light's distance is given in millimetres, but nothing gives the scale",
            "give a sphere's diameter_mm, or the capture's pixel_size",
        )
    return distance_mm / geometry.pixel_size
