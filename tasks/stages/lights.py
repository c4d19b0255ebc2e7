"""Lights: one half vector per frame, from the spheres or from known lights."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.masks_and_truth import read_lights
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.coverage import coverage
from glint.tasks.algorithms.lighting.focal_length import estimate_focal_length
from glint.tasks.algorithms.lighting.highlights import measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    BEHIND,
    REASONS,
    Lights,
    classify_frames,
    inter_sphere_angles,
    merge_spheres,
)
from glint.tasks.algorithms.lighting.near_light import PointLight, estimate_point_light
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.parameters import LightsParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, load_geometry, sphere_name
from glint.tasks.stages.frames import load_levels, open_frames, spread_shards

BLOCK_FRAMES = 1024
"""Frames whose highlights are measured at once."""
MAX_REFLECTION_SHARDS = 50
"""Most shards from which a sphere's static reflection is taken."""
MAX_LIGHT_DEVIATION_DEG = 2.2
"""Standard deviation of the lights' directions, from the spheres' fits, above which they are doubted."""
MIN_DISAGREEMENT_DEG, DISAGREEMENT_DEVIATIONS = 0.6, 2.5
"""Median angle between a sphere's half vectors and the mean that is doubted: at least, and in standard deviations."""
MAX_BEHIND_SHARE, SMALL_CIRCLE_DEG = 0.1, 7.0
"""Share of the highlights beyond r sin 45 from which the circle may be an edge inside the sphere, and the error of the
half vectors that this has."""
MAX_ELLIPSE_DEVIATION_RATIO = 0.01
"""Standard deviation of a sphere's centre, in radii, from which its misfit may look like an ellipse."""


def lights(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find half vector, light and reason of every frame.

    Raises:
        InputError: the known lights cannot be used; a distance of the light without a scale.
        UnusableCapture: no frame has a light before the object.
    """
    cache, geometry, known = open_frames(inputs), load_geometry(inputs), inputs.file("lights")
    if known is not None:
        result, point_light, warnings = _known(inputs, known, cache.frames), None, list[StageWarning]()
    else:
        result, point_light = _measured(inputs, geometry, cache, progress)
        warnings = sphere_doubts(geometry.spheres, result, is_near=point_light is not None) + _near_camera(
            inputs, geometry
        )
    accepted = int(result.accepted.sum())
    if accepted < 2:
        raise UnusableCapture(
            f"{accepted} of {cache.frames} frames has a light before the object",
            "record for longer and move the light over the whole hemisphere before the object",
        )
    median, worst = inter_sphere_angles(result)
    sweep = coverage(result.half_vectors)
    record = {
        "reasons": list(REASONS),
        "coverage": {
            "within_degrees": {f"{limit:g}": round(share, 4) for limit, share in sweep.covered_shares.items()},
            "gaps": [str(gap) for gap in sweep.gaps],
        },
        "near_lamp": None if point_light is None else asdict(point_light),
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
            "half_vector_sd": _half_vector_sd(geometry, result),
        },
        record=record,
        counts={"accepted": accepted, **rejected},
        warnings=[StageWarning(str(gap), "coverage") for gap in sweep.gaps] + warnings,
    )


def _half_vector_sd(geometry: CaptureGeometry, result: Lights) -> np.ndarray:
    """Return the standard deviation per axis (H, W) float32, radians, of an error that all half vectors share."""
    deviation = _spheres_sd(geometry.spheres, result)
    return np.full((geometry.region.height, geometry.region.width), deviation, np.float32)


def _spheres_sd(spheres: Sequence[Sphere], result: Lights) -> float:
    """Return the standard deviation per axis, radians, that the spheres' fits leave in the mean half vector."""
    variances = [sphere.half_vector_sd(result.half_vectors) ** 2 for sphere in spheres]
    return float(np.sqrt(np.sum(variances))) / len(variances) if variances else 0.0


def sphere_doubts(spheres: Sequence[Sphere], result: Lights, *, is_near: bool) -> list[StageWarning]:
    """Warn where the spheres' fits leave the light uncertain, and where two spheres disagree."""
    # The error has two axes; that of the light is twice that of the half vector.
    error = float(np.degrees(_spheres_sd(spheres, result))) * np.sqrt(2.0)
    if 2.0 * error > MAX_LIGHT_DEVIATION_DEG:
        message = (
            f"the chrome sphere's contour is known to {_contour_percent(spheres):.1f}% of its radius only, so"
            f" lights may be off by {2.0 * error:.1f} degrees: use a plain background unlike the sphere's rim, or"
            " give `spheres` in the catalogue"
        )
        return [StageWarning(message, "sphere", error)]
    highlights = (result.reason == ACCEPTED) | (result.reason == BEHIND)
    behind = float((result.reason[highlights] == BEHIND).mean()) if highlights.any() else 0.0
    if behind > MAX_BEHIND_SHARE:
        message = (
            f"{behind:.0%} of the highlights lie near the chrome sphere's contour, as if the light were behind the"
            " object: check in the picture that the circle is the sphere's contour and no smaller one inside it, or"
            " give `spheres`"
        )
        return [StageWarning(message, "sphere", SMALL_CIRCLE_DEG)]
    median, _ = inter_sphere_angles(result)
    if not is_near and median > max(MIN_DISAGREEMENT_DEG, DISAGREEMENT_DEVIATIONS * error):
        message = (
            f"the spheres disagree on the half vectors by {2.0 * median:.1f} degrees: check `spheres` in the catalogue,"
            " or leave out the worse sphere"
        )
        return [StageWarning(message, "sphere", 2.0 * median)]
    return []


def _contour_percent(spheres: Sequence[Sphere]) -> float:
    """Return the largest standard deviation of a sphere's centre in percent of its radius."""
    return max(100.0 * sphere.centre_sd / sphere.radius for sphere in spheres)


def load_point_light(results: CaptureResults) -> PointLight | None:
    """Load the near light that was measured or given; None: far away."""
    saved = results.load("lights").record["near_lamp"]
    return None if saved is None else PointLight(**saved)


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


def _measured(
    inputs: StageInputs, geometry: CaptureGeometry, cache: FrameCache, progress: Progress
) -> tuple[Lights, PointLight | None]:
    """Measure the lights on all spheres; with two, or a given distance, the near light as well."""
    parameters: LightsParameters = inputs.parameters
    by_sphere = []
    for number, sphere in enumerate(geometry.spheres):
        crop = geometry.crops[sphere_name(number)]
        in_crop, camera = sphere.in_crop(crop.x, crop.y), geometry.camera_within(crop)
        by_sphere.append(_of_sphere(parameters, cache, sphere_name(number), in_crop, camera))
        progress(number + 1, len(geometry.spheres))
    combined = merge_spheres(by_sphere, tolerance=parameters.tolerance)
    if parameters.distance is None:
        return combined, estimate_point_light([lights.half_vectors for lights in by_sphere], geometry.spheres)
    if geometry.pixel_size is None:
        raise InputError(
            "the light's distance is given in millimetres, but nothing gives the scale",
            "give a sphere's diameter_mm, or the capture's pixel_size",
        )
    return combined, PointLight.from_distance(geometry.spheres, parameters.distance / geometry.pixel_size)


def _near_camera(inputs: StageInputs, geometry: CaptureGeometry) -> list[StageWarning]:
    """Warn where a sphere's contour shows a near camera whose matrix is not given."""
    if geometry.camera is not None:
        return []
    width, height = geometry.frame_size
    for number, sphere in enumerate(geometry.spheres):
        if sphere.centre_sd > MAX_ELLIPSE_DEVIATION_RATIO * sphere.radius:
            continue
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
