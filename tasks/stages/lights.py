"""Lights: one half vector per frame, from the spheres or from known lights."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.masks_and_truth import read_lights
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.coverage import (
    EXTRAPOLATED_ERROR_DEG,
    Coverage,
    coverage,
    gaps_message,
)
from glint.tasks.algorithms.lighting.focal_length import focal_length_of_ellipse, measure_elongation
from glint.tasks.algorithms.lighting.highlights import measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    BEFORE_OBJECT,
    BEHIND,
    COVERED,
    REASONS,
    Lights,
    classify_frames,
    inter_sphere_angles,
    without_frames,
)
from glint.tasks.algorithms.lighting.occlusion import is_light_before_object, is_sphere_covered
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from glint.tasks.algorithms.near_light.half_vector_error import combined_error, unknown_camera_error
from glint.tasks.engine.parameters import LightsParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import OBJECT, CaptureGeometry, load_geometry, sphere_name
from glint.tasks.stages.frames import load_levels, load_thumbnails, open_frames, spread_shards
from glint.tasks.stages.light_distance import DistanceResult, measure_distance, region_pixels
from glint.tasks.stages.sphere_doubts import sphere_doubts, spheres_error

SPHERES, FILE = "spheres", "file"
"""Where the lights of a capture come from, as its record names it."""
BLOCK_FRAMES = 1024
"""Frames whose highlights are measured at once."""
OBJECT_BLOCK_FRAMES = 128
"""Frames of the object that are held at once."""
MAX_BEFORE_OBJECT_SHARE = 0.2
"""Share of the frames beyond which a bright border is no light before the object but an overexposed background."""
MAX_REFLECTION_SHARDS = 50
"""Most shards from which a sphere's static reflection is taken."""
MAX_ELLIPSE_SHARDS, ELLIPSE_FRAME_STEP = 12, 16
"""Most shards, and the step between their frames, in which a sphere's elongation is measured."""


def lights(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find half vector, light and reason of every frame.

    Raises:
        InputError: the known lights cannot be used; a distance of the light without a scale.
        UnusableCapture: no frame has a light before the object.
    """
    cache, geometry, known = open_frames(inputs), load_geometry(inputs), inputs.file("lights")
    if known is not None:
        measured = DistanceResult(_known(inputs, known, cache.frames), None, None, [], [])
        warnings = list[StageWarning]()
    else:
        by_sphere = _by_sphere(inputs, geometry, cache, progress)
        parameters: LightsParameters = inputs.parameters
        measured = measure_distance(
            by_sphere, geometry, load_thumbnails(inputs), parameters.tolerance, parameters.distance
        )
        measured = _with_unknown_camera(inputs, geometry, by_sphere, measured)
        doubts = sphere_doubts(geometry.spheres, measured.lights, is_near=measured.near is not None)
        warnings = [*doubts, *measured.warnings]
    result = without_frames(measured.lights, _is_light_before_object(inputs, cache), BEFORE_OBJECT)
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
        "source": SPHERES if known is None else FILE,
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
            "half_vector_sd": combined_error(
                [np.full(shape, spheres_error(geometry.spheres, result)), *measured.errors]
            ),
        },
        record=record,
        counts={"accepted": accepted, **rejected},
        warnings=[*_gap_warnings(sweep), *warnings],
    )


def _gap_warnings(sweep: Coverage) -> list[StageWarning]:
    """Return one warning of all gaps in the sweep, none without gaps."""
    return [StageWarning(gaps_message(sweep.gaps), "coverage", EXTRAPOLATED_ERROR_DEG)] if sweep.gaps else []


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


def _by_sphere(inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache, progress: Progress) -> list[Lights]:
    """Measure the lights on all spheres."""
    by_sphere = []
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        in_crop, camera = sphere.in_crop(crop.x, crop.y), geometry.camera_within(crop)
        by_sphere.append(_of_sphere(inputs.parameters, cache, sphere_name(number), in_crop, camera))
        progress(number + 1, len(geometry.spheres))
    return by_sphere


def _with_unknown_camera(
    inputs: StageInputs, geometry: CaptureGeometry, by_sphere: Sequence[Lights], measured: DistanceResult
) -> DistanceResult:
    """Return the lights in doubt by the view vectors, with a warning, if a near camera is seen and not given."""
    width, height = geometry.frame_size
    centre = (width - 1) / 2, (height - 1) / 2
    if geometry.camera is not None:
        return measured
    focal = focal_length_of_parallax([lights.half_vectors for lights in by_sphere], geometry.spheres, centre)
    if focal == np.inf:
        return measured
    if focal is not None:
        evidence = "the spheres show the light in directions that only a near camera explains"
    else:
        ellipse = _focal_length_of_ellipses(inputs, geometry)
        if ellipse is None:
            return measured
        sphere, focal = ellipse
        evidence = f"the sphere at ({sphere.x:.0f}, {sphere.y:.0f}) is seen as an ellipse, as by a near camera"
    error = unknown_camera_error(region_pixels(geometry), geometry.spheres, centre, focal)
    matrix = f"[[{focal:.0f}, 0, {centre[0]:g}], [0, {focal:.0f}, {centre[1]:g}], [0, 0, 1]]"
    message = (
        f"{evidence}, with a focal length of some {focal:.0f} pixels: give the camera's matrix, about"
        f" `camera: {{matrix: {matrix}}}`, or record from farther away with a longer lens"
    )
    warning = StageWarning(message, "camera", float(np.degrees(np.sqrt(2.0) * np.median(error))))
    return replace(measured, errors=[*measured.errors, error], warnings=[*measured.warnings, warning])


def _focal_length_of_ellipses(inputs: StageInputs, geometry: CaptureGeometry) -> tuple[Sphere, float] | None:
    """Return the first sphere whose contour shows a near camera, and the focal length in pixels."""
    width, height = geometry.frame_size
    cache = open_frames(inputs)
    shards = spread_shards(cache.frames, MAX_ELLIPSE_SHARDS)
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        background, peak = load_levels(inputs, sphere_name(number))
        middle = (width - 1) / 2 - crop.x, (height - 1) / 2 - crop.y
        frames = np.concatenate(
            [cache.read(sphere_name(number), slice(start, start + 64))[::ELLIPSE_FRAME_STEP] for start in shards]
        )
        levels = frames * np.float32(1.0 if frames.dtype == np.uint8 else 1.0 / 257.0)
        in_crop = sphere.in_crop(crop.x, crop.y)
        focal = focal_length_of_ellipse(
            background, peak, measure_elongation(levels, in_crop, middle), in_crop, middle, width
        )
        if focal is not None:
            return sphere, focal * width
    return None


def _of_sphere(
    parameters: LightsParameters, cache: FrameCache, name: str, sphere: Sphere, camera: np.ndarray | None
) -> Lights:
    """Measure the lights on one sphere, in the pixels of its crop."""
    step, shards = 16 if cache.frames > 640 else 1, spread_shards(cache.frames, MAX_REFLECTION_SHARDS)
    sample = np.concatenate([cache.read(name, slice(start, start + 64))[::step] for start in shards])
    static = static_background(sample, sphere, camera=camera)
    blocks, covered = [], []
    for start in range(0, cache.frames, BLOCK_FRAMES):
        frames = cache.read(name, slice(start, start + BLOCK_FRAMES))
        covered.append(is_sphere_covered(frames, static.background, static.saturation, sphere))
        block = measure_highlights(
            frames,
            sphere,
            static,
            peak_level=parameters.peak_level,
            edge_level=parameters.edge_level,
            full_level=parameters.full_level,
            camera=camera,
        )
        blocks.append(block)
    lights = classify_frames(
        blocks, static, sphere, second_light_ratio=parameters.second_light_ratio, area_ratio=parameters.area_ratio
    )
    return without_frames(lights, np.concatenate(covered), COVERED)


def _is_light_before_object(inputs: StageInputs, cache: FrameCache) -> np.ndarray:
    """Return whether the light itself stands before the object, (T,) bool."""
    background, _ = load_levels(inputs)
    blocks = [
        is_light_before_object(cache.read(OBJECT, slice(start, start + OBJECT_BLOCK_FRAMES)), background)
        for start in range(0, cache.frames, OBJECT_BLOCK_FRAMES)
    ]
    before = np.concatenate(blocks)
    return before if before.mean() <= MAX_BEFORE_OBJECT_SHARE else np.zeros_like(before)
