"""Doubt of the half vectors where the camera's matrix is not given and the camera is, or may be, near."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.lighting.focal_length import focal_length_of_ellipse, measure_elongation
from glint.tasks.algorithms.lighting.lights import Lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from glint.tasks.algorithms.near_light.half_vector_error import unknown_camera_error
from glint.tasks.algorithms.near_light.positions import mean_distance
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, sphere_name
from glint.tasks.stages.frames import load_levels, spread_shards
from glint.tasks.stages.light_distance import DistanceResult, region_pixels

MIN_CAMERA_COST_DEG = 1.0
"""Usual error, by a camera that may be as near as the light, below which there is no warning."""
MAX_ELLIPSE_SHARDS, ELLIPSE_FRAME_STEP = 12, 16
"""Most shards of 64 frames, and the step between their frames, in which a sphere's elongation is measured."""


def with_unknown_camera(
    inputs: StageInputs,
    geometry: CaptureGeometry,
    cache: FrameCache,
    by_sphere: Sequence[Lights],
    measured: DistanceResult,
) -> DistanceResult:
    """Return the lights in doubt by the view vectors if the camera's matrix is not given and the camera may be near.

    by_sphere: lights of each sphere; measured: those of all. A warning says what shows the near camera, or that nothing
    excludes it.
    """
    if geometry.camera is not None:
        return measured
    width, height = geometry.frame_size
    centre = (width - 1) / 2, (height - 1) / 2
    focal = focal_length_of_parallax([lights.half_vectors for lights in by_sphere], geometry.spheres, centre)
    if focal == np.inf:
        return measured
    ellipse = _focal_length_of_ellipses(inputs, geometry, cache) if focal is None else None
    if focal is not None:
        evidence, is_seen = "the spheres show the light in directions that only a near camera explains", True
    elif ellipse is not None:
        sphere, focal = ellipse
        evidence = f"the sphere at ({sphere.x:.0f}, {sphere.y:.0f}) is seen as an ellipse, as by a near camera"
        is_seen = True
    elif measured.near is not None:
        # Light and camera stand on the same side of the object, and nothing shows that the camera is farther away.
        focal, is_seen = mean_distance(measured.near.inverse_distance), False
        evidence = "the light was near, and a single sphere does not show whether the camera was as near"
    else:
        return measured
    error = unknown_camera_error(region_pixels(geometry), geometry.spheres, centre, focal)
    cost = float(np.degrees(np.sqrt(2.0) * np.median(error)))
    doubted = replace(measured, errors=[*measured.errors, error])
    if not is_seen and cost < MIN_CAMERA_COST_DEG:
        return doubted
    matrix = f"[[{focal:.0f}, 0, {centre[0]:g}], [0, {focal:.0f}, {centre[1]:g}], [0, 0, 1]]"
    remedy = (
        f"with a focal length of some {focal:.0f} pixels: give the camera's matrix, about"
        f" `camera: {{matrix: {matrix}}}`, or record from farther away with a longer lens"
        if is_seen
        else f"with a focal length of some {focal:.0f} pixels or more: give the camera's matrix (`camera`), also of a"
        " long lens, or use two spheres"
    )
    warning = StageWarning(f"{evidence}, {remedy}", "camera", cost)
    return replace(doubted, warnings=[*measured.warnings, warning])


def _focal_length_of_ellipses(
    inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache
) -> tuple[Sphere, float] | None:
    """Return the first sphere whose contour shows a near camera, and the focal length in pixels."""
    width, height = geometry.frame_size
    shards = spread_shards(cache.frames, MAX_ELLIPSE_SHARDS)
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        background, peak = load_levels(inputs, sphere_name(number))
        middle, in_crop = ((width - 1) / 2 - crop.x, (height - 1) / 2 - crop.y), sphere.in_crop(crop.x, crop.y)
        crops = [cache.read(sphere_name(number), slice(start, start + 64))[::ELLIPSE_FRAME_STEP] for start in shards]
        levels = np.concatenate(crops) * np.float32(1.0 if cache.bits == 8 else 1.0 / 257.0)
        elongation = measure_elongation(levels, in_crop, middle)
        focal = focal_length_of_ellipse(background, peak, elongation, in_crop, middle, width)
        if focal is not None:
            return sphere, focal * width
    return None
