"""Doubt of the half vectors where the camera's matrix is not given and the camera is, or may be, near."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.lighting.focal_length import estimate_focal_length
from glint.tasks.algorithms.lighting.lights import Lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.ellipse import is_confirmed_ellipse
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from glint.tasks.algorithms.near_light.half_vector_error import unknown_camera_error
from glint.tasks.algorithms.near_light.positions import mean_distance
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, sphere_name
from glint.tasks.stages.frames import load_levels, spread_shards
from glint.tasks.stages.light_distance import DistanceResult, region_pixels

MIN_ELONGATION_PX = 1.0
"""Pixels by which an ellipse's half axes must differ at the focal length that it suggests: less is no evidence."""
MIN_CAMERA_COST_DEG = 1.0
"""Usual error, by a camera that may be as near as the light, below which there is no warning."""
ELLIPSE_SHARDS, ELLIPSE_STEP = 8, 8
"""Most shards of 64 frames from which a sphere's contour is taken, and the step between their frames."""
MAX_ELLIPSE_DEVIATION_RATIO = 0.02
"""Standard deviation of a sphere's centre, in radii, from which its misfit may look like an ellipse."""


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
    for number, sphere in enumerate(geometry.spheres):
        if sphere.centre_sd > MAX_ELLIPSE_DEVIATION_RATIO * sphere.radius:
            continue
        crop = geometry.crops[sphere_name(number)]
        background, peak = load_levels(inputs, sphere_name(number))
        middle, in_crop = ((width - 1) / 2 - crop.x, (height - 1) / 2 - crop.y), sphere.in_crop(crop.x, crop.y)
        widths = estimate_focal_length(background, peak, in_crop, middle, width)
        if widths is None:
            continue
        focal = widths * width
        offset = np.hypot(sphere.x - (width - 1) / 2, sphere.y - (height - 1) / 2) / focal
        # The long half axis of a sphere at an angle from the axis exceeds the short one by 1 / cos.
        if sphere.radius * (np.hypot(1.0, offset) - 1.0) <= MIN_ELONGATION_PX:
            continue
        shards = spread_shards(cache.frames, ELLIPSE_SHARDS)
        crops = [cache.read(sphere_name(number), slice(start, start + 64))[::ELLIPSE_STEP] for start in shards]
        frames = np.concatenate(crops) / (1.0 if cache.bits == 8 else 257.0)
        if is_confirmed_ellipse(frames, in_crop, middle, focal):
            return sphere, focal
    return None
