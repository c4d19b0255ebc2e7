"""The light's distance: given, measured by several spheres, or unknown; and what not knowing it costs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glint.storage.errors import InputError
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.half_vector_error import (
    PixelGrid,
    depth_error,
    light_distance_error,
    unknown_distance_error,
)
from glint.tasks.algorithms.lighting.lights import Lights, merge_spheres
from glint.tasks.algorithms.lighting.near_light import NearLight, SphereLights
from glint.tasks.algorithms.lighting.triangulation import LightDistance, rotated, triangulate
from glint.tasks.engine.stage_inputs import CaptureResults
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry

GIVEN_ERROR, TRIANGULATED_ERROR = 0.1, 0.05
"""Relative standard deviation of an inverse distance that was given (a hand's distance varies) or triangulated (the
spheres' depths differ)."""


@dataclass(frozen=True)
class DistanceResult:
    """lights: those of all spheres, seen from the reference point of a near light; near: its positions, None for a
    distant one; rotations: see `LightDistance`, None unless triangulated; record: to be saved; errors: of half vectors,
    (H, W) radians per axis; warnings."""

    lights: Lights
    near: NearLight | None
    rotations: np.ndarray | None
    record: Mapping[str, Any] | None
    errors: Sequence[np.ndarray]
    warnings: Sequence[StageWarning]


def measure_distance(
    by_sphere: Sequence[Lights], geometry: CaptureGeometry, tolerance: float, distance_mm: float | None
) -> DistanceResult:
    """Merge the lights of all spheres, corrected for the parallax of a near light where its distance is known.

    Args:
        by_sphere: of `geometry.spheres`.
        geometry: of the capture.
        tolerance: see `merge_spheres`.
        distance_mm: that the user gave.

    Raises:
        InputError: a distance is given, but no scale.
    """
    pixels = region_pixels(geometry)
    sphere_lights = [
        SphereLights.of(lights.half_vectors, sphere, reference_point(geometry), geometry.camera)
        for lights, sphere in zip(by_sphere, geometry.spheres, strict=True)
    ]
    if distance_mm is not None:
        inverse = np.full(len(by_sphere[0].reason), 1.0 / _in_pixels(distance_mm, geometry))
        found = LightDistance(inverse, GIVEN_ERROR * float(inverse[0]), False, np.zeros((len(by_sphere), 2)))
    else:
        triangulated = triangulate(sphere_lights)
        if triangulated is None:
            return _distant(by_sphere, geometry, tolerance)
        found = triangulated
    moved = [
        _seen_from_reference(lights, site, found.inverse_distance, rotation)
        for lights, site, rotation in zip(by_sphere, sphere_lights, found.rotations, strict=True)
    ]
    merged = merge_spheres(moved, tolerance=tolerance)
    inverse = found.inverse_distance
    near = NearLight(*reference_point(geometry), merged.half_vectors, inverse.astype(np.float32))
    middle = float(np.median(inverse))
    low, high = np.percentile(inverse, (95.0, 5.0))
    record = {
        "x": near.x,
        "y": near.y,
        "distance": 1.0 / middle,
        "least": float(1.0 / low),
        "greatest": float(1.0 / high),
        "source": "spheres" if distance_mm is None else "given",
    }
    share = TRIANGULATED_ERROR if distance_mm is None else GIVEN_ERROR
    errors = [
        light_distance_error(pixels, geometry.spheres, float(np.hypot(share * middle, found.standard_error))),
        depth_error(pixels, middle),
    ]
    rotations = found.rotations if distance_mm is None else None
    return DistanceResult(merged, near, rotations, record, errors, [])


def _distant(by_sphere: Sequence[Lights], geometry: CaptureGeometry, tolerance: float) -> DistanceResult:
    """Merge the lights as those of a distant light, in doubt where no two spheres could measure it."""
    merged = merge_spheres(by_sphere, tolerance=tolerance)
    several = np.isfinite(merged.inter_sphere_angle).sum()
    pixels = region_pixels(geometry)
    errors = [] if several else [unknown_distance_error(pixels, geometry.spheres)]
    return DistanceResult(merged, None, None, None, errors, [])


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
    return replace(
        lights,
        half_vectors=half_vectors_of(corrected).astype(np.float32),
        lights=corrected.astype(np.float32),
    )


def _in_pixels(distance_mm: float, geometry: CaptureGeometry) -> float:
    if geometry.pixel_size is None:
        raise InputError(
            "the light's distance is given in millimetres, but nothing gives the scale",
            "give a sphere's diameter_mm, or the capture's pixel_size",
        )
    return distance_mm / geometry.pixel_size
