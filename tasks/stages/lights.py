"""Lights: one half vector per frame, from the spheres or from known lights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.footage.copies import image_files
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.masks_and_truth import read_lights
from glint.tasks.algorithms.errors import UnusableCapture, UnusableSphere
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.coverage import (
    EXTRAPOLATED_ERROR_DEG,
    Coverage,
    coverage,
    gaps_message,
)
from glint.tasks.algorithms.lighting.highlights import BlobLevels, measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    BEFORE_OBJECT,
    BEHIND,
    BLOCK_FRAMES,
    COVERED,
    REASONS,
    Lights,
    classify_frames,
    inter_sphere_angles,
    light_size,
    without_frames,
)
from glint.tasks.algorithms.lighting.occlusion import is_light_before_object, is_sphere_covered, may_show_light
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.half_vector_error import combined_error
from glint.tasks.engine.parameters import LightsParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.camera_doubt import with_camera_of_spheres
from glint.tasks.stages.capture_geometry import OBJECT, CaptureGeometry, load_geometry, sphere_name
from glint.tasks.stages.frames import load_thumbnails, open_frames
from glint.tasks.stages.levels import CLIPPED, LEVEL_FRAMES, load_levels, spread_runs
from glint.tasks.stages.light_distance import DistanceResult, measure_distance
from glint.tasks.stages.sphere_doubts import circles_error, sphere_doubts, sweep_error

SPHERES, FILE = "spheres", "file"
"""Where the lights of a capture come from, as its record names it."""
MISPLACED_REMEDY = "correct `spheres` in the catalogue if the chrome sphere lies elsewhere; if it does not"
"""What is to be done first about a given sphere that shows no light."""
MAX_BEFORE_OBJECT_SHARE = 0.2
"""Share of the frames beyond which a bright border is no light before the object but an overexposed background."""
MIN_BEFORE_OBJECT_SHARE, BEFORE_OBJECT_COST_DEG = 0.01, 1.0
"""Share of the frames from which a light before the object is reported, and what its disc costs where it is not noticed
because it lies half behind the object: half a degree in the mean of a simulated dome with a tenth of such frames."""
DISC_ERROR_DEG = 0.6
"""Standard deviation per axis of the centre of the disc of half vectors that a light of twice the usual size lights,
beyond that of a usual one (`python -m tests.benchmarks.light_sizes`)."""
MAX_REFLECTION_RUNS = 50
"""Most runs of frames from which a sphere's static reflection is taken."""
REFLECTION_STEP, MAX_UNTHINNED_FRAMES = 16, 640
"""Frames of these runs from one that is taken to the next, and frames of a capture up to which all are taken."""


@dataclass(frozen=True, slots=True)
class _MeasuredLights:
    """Lights of all frames, corrected for their distance.

    camera: record of the camera that the spheres show, None without. light_radius: in degrees, None: unknown.
    circle_sd: radians per axis, see `circles_error`.
    """

    distance: DistanceResult
    camera: Mapping[str, Any] | None = None
    light_radius: float | None = None
    circle_sd: float = 0.0
    warnings: Sequence[StageWarning] = ()


def lights(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find half vector, light and reason of every frame.

    Raises:
        InputError: the known lights cannot be used; a distance of the light without a scale.
        UnusableSphere: one shows no light; UnusableCapture: no frame has a light before the object.
    """
    cache, geometry, known = open_frames(inputs), load_geometry(inputs), inputs.file("lights")
    if known is None:
        measured = _of_spheres(inputs, geometry, cache, progress)
    else:
        measured = _MeasuredLights(DistanceResult(_known(inputs, known, cache.frames), None, None, [], []))
    before = _is_light_before_object(inputs, cache)
    result = without_frames(measured.distance.lights, before, BEFORE_OBJECT)
    accepted, *counts = np.bincount(result.reason, minlength=len(REASONS)).tolist()
    rejected = {reason: count for reason, count in zip(REASONS[1:], counts, strict=True) if count}
    if accepted < 2:
        reasons = ", ".join(f"{count} {reason}" for reason, count in rejected.items())
        raise UnusableCapture(
            f"{accepted} of {cache.frames} frames {'has' if accepted == 1 else 'have'} a light before the object"
            f" (rejected: {reasons})",
            "record for longer and move the light over the whole hemisphere before the object",
        )
    shared_sd = float(np.hypot(_disc_error(measured.light_radius), measured.circle_sd))
    everywhere_sd = np.full((geometry.region.height, geometry.region.width), shared_sd)
    sweep = coverage(result.half_vectors)
    return StageOutput(
        arrays={
            "half_vectors": result.half_vectors,
            "lights": result.lights,
            "reason": result.reason,
            "inverse_distance": _inverse_distance(measured.distance),
            "half_vector_sd": combined_error([everywhere_sd, *measured.distance.errors]),
        },
        record=_record(measured, result, sweep, geometry, SPHERES if known is None else FILE),
        counts={"accepted": accepted} | {f"rejected: {reason}": count for reason, count in rejected.items()},
        warnings=[*_gap_warnings(sweep), *_before_object_warnings(before), *measured.warnings],
    )


def _of_spheres(
    inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache, progress: Progress
) -> _MeasuredLights:
    """Measure the lights on the spheres, their distance and the camera."""
    is_given = bool(inputs.load("survey").record.get("given_spheres"))
    by_sphere = _by_sphere(inputs, geometry, cache, progress, is_given)
    parameters: LightsParameters = inputs.parameters
    measured = measure_distance(by_sphere, geometry, load_thumbnails(inputs), parameters.tolerance, parameters.distance)
    measured, camera = with_camera_of_spheres(geometry, by_sphere, measured)
    spheres, is_near = geometry.spheres, measured.near is not None
    doubts = sphere_doubts(spheres, measured.lights, is_near=is_near, is_given=is_given, by_sphere=by_sphere)
    light_radius = _light_radius(by_sphere, geometry)
    circle_sd = circles_error(spheres, measured.lights, is_near=is_near)
    return _MeasuredLights(measured, camera, light_radius, circle_sd, [*doubts, *measured.warnings])


def _record(
    measured: _MeasuredLights, result: Lights, sweep: Coverage, geometry: CaptureGeometry, source: str
) -> dict[str, Any]:
    """Return the record of the lights that are kept, of their sweep, and of what was measured beside them."""
    median, percentile_95 = inter_sphere_angles(result)
    return {
        "source": source,
        "reasons": list(REASONS),
        "coverage": {
            "within_degrees": {f"{limit:g}": round(share, 4) for limit, share in sweep.covered_shares.items()},
            "gaps": [str(gap) for gap in sweep.gaps],
        },
        "near_light": measured.distance.record,
        "inverse_distance_sd": measured.distance.inverse_distance_sd,
        "camera": measured.camera,
        "light_radius_degrees": measured.light_radius,
        "spheres_error": sweep_error(geometry.spheres, result),
        "disagreement_degrees": None if np.isnan(median) else {"median": median, "95th percentile": percentile_95},
    }


def _gap_warnings(sweep: Coverage) -> list[StageWarning]:
    """Return one warning of all gaps in the sweep, none without gaps."""
    return [StageWarning(gaps_message(sweep.gaps), "coverage", EXTRAPOLATED_ERROR_DEG)] if sweep.gaps else []


def _before_object_warnings(before: np.ndarray) -> list[StageWarning]:
    """Warn of a light that shows itself beside or before the object in some frames (T,) bool."""
    if before.mean() < MIN_BEFORE_OBJECT_SHARE:
        return []
    message = (
        f"the light itself shows in the object's region in {before.sum()} of {len(before)} frames, which are left out:"
        " hold it, and the arm, outside the picture of the object"
    )
    return [StageWarning(message, "light", BEFORE_OBJECT_COST_DEG)]


def _inverse_distance(measured: DistanceResult) -> np.ndarray:
    """Return the inverse distance (T,) float32 of the light, 1/pixels; 0 for a distant one."""
    near = measured.near
    return np.zeros(len(measured.lights.reason), np.float32) if near is None else near.inverse_distance


def _known(inputs: StageInputs, address: str, count: int) -> Lights:
    """Read the lights of an `.lp` file; those behind the object are rejected."""
    video = inputs.file("frames")
    assert video is not None
    images = image_files(video)
    names = () if images is None else tuple(file.name for file in images.kept)
    directions = read_lights(address, names, count, () if images is None else images.skipped)
    reason = np.where(directions[:, 2] >= 0, ACCEPTED, BEHIND).astype(np.uint8)
    kept = np.where((reason == ACCEPTED)[:, None], directions, np.nan).astype(np.float32)
    unknown = np.full(len(kept), np.nan, np.float32)
    return Lights(half_vectors_of(kept).astype(np.float32), kept, reason, unknown, unknown)


def _by_sphere(
    inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache, progress: Progress, is_given: bool
) -> list[Lights]:
    """Measure the lights on all spheres; is_given: whether a person gave them."""
    by_sphere = []
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        in_crop, camera = sphere.in_crop(crop.x, crop.y), geometry.camera_within(crop)
        try:
            by_sphere.append(_of_sphere(inputs.parameters, cache, sphere_name(number), in_crop, camera))
        except UnusableCapture as error:
            place = f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f}"
            remedy = f"{MISPLACED_REMEDY}, {error.remedy}" if is_given else error.remedy
            raise UnusableSphere(f"{place}: {error.message}", remedy) from error
        progress(number + 1, len(geometry.spheres))
    return by_sphere


def _light_radius(by_sphere: Sequence[Lights], geometry: CaptureGeometry) -> float:
    """Return the light's angular radius in degrees: the smallest of the spheres', as blur enlarges it."""
    return min(lights.angular_radius(sphere.radius) for lights, sphere in zip(by_sphere, geometry.spheres, strict=True))


def _disc_error(light_radius: float | None) -> float:
    """Return the standard deviation per axis, radians, of the centres of the discs that a large light lights."""
    return float(np.radians(DISC_ERROR_DEG * (light_size(light_radius) - 1.0)))


def _of_sphere(
    parameters: LightsParameters, cache: FrameCache, name: str, sphere: Sphere, camera: np.ndarray | None
) -> Lights:
    """Measure the lights on one sphere, in the pixels of its crop."""
    step = REFLECTION_STEP if cache.frames > MAX_UNTHINNED_FRAMES else 1
    starts = spread_runs(cache.frames, MAX_REFLECTION_RUNS)
    sample = np.concatenate([cache.read(name, slice(start, start + LEVEL_FRAMES))[::step] for start in starts])
    static = static_background(sample, sphere, camera=camera)
    levels = BlobLevels(parameters.peak_level, parameters.edge_level, parameters.full_level)
    blocks, covered = [], []
    for start in range(0, cache.frames, BLOCK_FRAMES):
        frames = cache.read(name, slice(start, start + BLOCK_FRAMES))
        covered.append(is_sphere_covered(frames, static.background, static.saturation, sphere))
        blocks.append(measure_highlights(frames, sphere, static, levels, camera=camera))
    lights = classify_frames(
        blocks, static, sphere, second_light_ratio=parameters.second_light_ratio, area_ratio=parameters.area_ratio
    )
    return without_frames(lights, np.concatenate(covered), COVERED)


def _is_light_before_object(inputs: StageInputs, cache: FrameCache) -> np.ndarray:
    """Return whether the light itself stands before the object, (T,) bool."""
    background, _ = load_levels(inputs)
    suspects = may_show_light(inputs.load("frames").read(CLIPPED), background)
    before = np.zeros(cache.frames, bool)
    for start in range(0, cache.frames, cache.shard_frames):
        shard = slice(start, start + cache.shard_frames)
        if suspects[shard].any():
            before[shard] = is_light_before_object(cache.read(OBJECT, shard), background)
    return before if before.mean() <= MAX_BEFORE_OBJECT_SHARE else np.zeros_like(before)
