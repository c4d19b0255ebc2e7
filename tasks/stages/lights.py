"""Lights: one half vector per frame, from the spheres or from known lights."""

import numpy as np

from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.masks_and_truth import read_lights
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.coverage import coverage
from glint.tasks.algorithms.lighting.focal_length import estimate_focal_length
from glint.tasks.algorithms.lighting.half_vector_error import combined_error
from glint.tasks.algorithms.lighting.highlights import measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    BEHIND,
    REASONS,
    Lights,
    classify_frames,
    inter_sphere_angles,
)
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.parameters import LightsParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, load_geometry, sphere_name
from glint.tasks.stages.frames import load_levels, open_frames, spread_shards
from glint.tasks.stages.light_distance import DistanceResult, measure_distance

BLOCK_FRAMES = 1024
"""Frames whose highlights are measured at once."""
MAX_REFLECTION_SHARDS = 50
"""Most shards from which a sphere's static reflection is taken."""


def lights(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find half vector, light and reason of every frame.

    Raises:
        InputError: the known lights cannot be used; a distance of the light without a scale.
        UnusableCapture: no frame has a light before the object.
    """
    cache, geometry, known = open_frames(inputs), load_geometry(inputs), inputs.file("lights")
    if known is not None:
        measured = DistanceResult(_known(inputs, known, cache.frames), None, None, None, [], [])
        warnings = list[StageWarning]()
    else:
        measured = _measured(inputs, geometry, cache, progress)
        warnings = [*measured.warnings, *_near_camera(inputs, geometry)]
    result = measured.lights
    accepted = int(result.accepted.sum())
    if accepted < 2:
        raise UnusableCapture(
            f"{accepted} of {cache.frames} frames has a light before the object",
            "record for longer and move the light over the whole hemisphere before the object",
        )
    shape = (geometry.region.height, geometry.region.width)
    median, worst = inter_sphere_angles(result)
    sweep = coverage(result.half_vectors)
    record = {
        "reasons": list(REASONS),
        "coverage": {
            "within_degrees": {f"{limit:g}": round(share, 4) for limit, share in sweep.covered_shares.items()},
            "gaps": [str(gap) for gap in sweep.gaps],
        },
        "near_light": measured.record,
        "disagreement_degrees": None if np.isnan(median) else {"median": median, "95th percentile": worst},
    }
    rejected = {
        f"rejected: {reason}": int((result.reason == code).sum())
        for code, reason in enumerate(REASONS)
        if code != ACCEPTED and (result.reason == code).any()
    }
    return StageOutput(
        arrays={
            "half_vectors": result.half_vectors,
            "lights": result.lights,
            "reason": result.reason,
            "inverse_distance": _inverse_distance(measured),
            "half_vector_sd": combined_error([np.zeros(shape), *measured.errors]),
        },
        record=record,
        counts={"accepted": accepted, **rejected},
        warnings=[StageWarning(str(gap), "coverage") for gap in sweep.gaps] + warnings,
    )


def _inverse_distance(measured: DistanceResult) -> np.ndarray:
    """Return the inverse distance (T,) float32 of the light, 1/pixels; 0 for a distant one."""
    near = measured.near
    return np.zeros(len(measured.lights.reason), np.float32) if near is None else near.inverse_distance


def _known(inputs: StageInputs, address: str, count: int) -> Lights:
    """Read the lights of an `.lp` file; those behind the object are rejected."""
    video = inputs.file("frames")
    assert video is not None
    with open_footage(video) as footage:
        directions = read_lights(address, footage.names, count)
    reason = np.where(directions[:, 2] >= 0, ACCEPTED, BEHIND).astype(np.uint8)
    kept = np.where((reason == ACCEPTED)[:, None], directions, np.nan).astype(np.float32)
    unknown = np.full(len(kept), np.nan, np.float32)
    return Lights(half_vectors_of(kept).astype(np.float32), kept, reason, unknown, unknown)


def _measured(inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache, progress: Progress) -> DistanceResult:
    """Measure the lights on all spheres, and the distance of a near light."""
    parameters: LightsParameters = inputs.parameters
    by_sphere = []
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        in_crop, camera = sphere.in_crop(crop.x, crop.y), geometry.camera_within(crop)
        by_sphere.append(_of_sphere(parameters, cache, sphere_name(number), in_crop, camera))
        progress(number + 1, len(geometry.spheres))
    return measure_distance(by_sphere, geometry, parameters.tolerance, parameters.distance)


def _near_camera(inputs: StageInputs, geometry: CaptureGeometry) -> list[StageWarning]:
    """Warn where a sphere's contour shows a near camera whose matrix is not given."""
    if geometry.camera is not None:
        return []
    width, height = geometry.frame_size
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        background, peak = load_levels(inputs, sphere_name(number))
        middle = (width - 1) / 2 - crop.x, (height - 1) / 2 - crop.y
        focal = estimate_focal_length(background, peak, sphere.in_crop(crop.x, crop.y), middle, width)
        if focal is not None:
            message = (
                f"the sphere at ({sphere.x:.0f}, {sphere.y:.0f}) is seen as an ellipse, as by a near camera with a"
                f" focal length of some {focal:.1f} frame widths: give `camera: {{matrix: ..}}`, or record from farther"
                " away with a longer lens"
            )
            return [StageWarning(message, "camera")]
    return []


def _of_sphere(
    parameters: LightsParameters, cache: FrameCache, name: str, sphere: Sphere, camera: np.ndarray | None
) -> Lights:
    """Measure the lights on one sphere, in the pixels of its crop."""
    step, shards = 16 if cache.frames > 640 else 1, spread_shards(cache.frames, MAX_REFLECTION_SHARDS)
    sample = np.concatenate([cache.read(name, slice(start, start + 64))[::step] for start in shards])
    static = static_background(sample, sphere, camera=camera)
    blocks = [
        measure_highlights(
            cache.read(name, slice(start, start + BLOCK_FRAMES)),
            sphere,
            static,
            peak_level=parameters.peak_level,
            edge_level=parameters.edge_level,
            full_level=parameters.full_level,
            camera=camera,
        )
        for start in range(0, cache.frames, BLOCK_FRAMES)
    ]
    return classify_frames(
        blocks, static, sphere, second_light_ratio=parameters.second_light_ratio, area_ratio=parameters.area_ratio
    )
