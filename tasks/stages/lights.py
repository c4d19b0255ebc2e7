"""Lights: one half vector per frame, from the spheres or from known lights."""

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
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import camera_within, crops_of, levels, open_frames, spheres_of

BLOCK = 1024
SAMPLED_SHARDS = 50


def lights(work: Workspace, progress: Progress) -> Outcome:
    """Half vector, light and reason of every frame.

    Raises:
        InputError: the known lights are unusable; a distance of the lamp without a scale.
        UnusableCapture: no frame has a light before the object.
    """
    cache = open_frames(work)
    if work.capture.lights:
        found, lamp, told = _known(work, cache.frames), None, []
    else:
        found, lamp = _seen(work, cache, progress)
        told = _near_camera(work, cache)
    accepted = int(found.accepted.sum())
    if accepted < 2:
        raise UnusableCapture(
            f"{accepted} of {cache.frames} frames has a light before the object",
            "film for longer and move the lamp over the whole hemisphere before the object",
        )
    median, worst = inter_sphere_angles(found)
    swept = coverage(found.half_vectors)
    record = {
        "reasons": list(REASONS),
        "coverage": {
            "within_degrees": {f"{limit:g}": round(share, 4) for limit, share in swept.covered_shares.items()},
            "gaps": [str(gap) for gap in swept.gaps],
        },
        "near_lamp": None if lamp is None else asdict(lamp),
        "disagreement_degrees": None if np.isnan(median) else {"median": median, "95th percentile": worst},
    }
    rejected = {
        f"rejected: {reason}": int((found.reason == code).sum())
        for code, reason in enumerate(REASONS)
        if code != ACCEPTED and (found.reason == code).any()
    }
    return Outcome(
        arrays={"half_vectors": found.half_vectors, "lights": found.lights, "reason": found.reason},
        record=record,
        counts={"accepted": accepted, **rejected},
        warnings=[str(gap) for gap in swept.gaps] + told,
    )


def _known(work: Workspace, count: int) -> Lights:
    """Lights of an `.lp` file; those behind the object are rejected."""
    assert work.capture.lights is not None
    with open_footage(work.capture.frames) as footage:
        directions = read_lights(work.capture.lights, footage.names, count)
    reason = np.where(directions[:, 2] >= 0, ACCEPTED, BEHIND).astype(np.uint8)
    kept = np.where((reason == ACCEPTED)[:, None], directions, np.nan).astype(np.float32)
    unknown = np.full(len(kept), np.nan, np.float32)
    return Lights(half_vectors_of(kept).astype(np.float32), kept, reason, unknown, unknown)


def near_lamp_of(work: Workspace) -> PointLight | None:
    """The near lamp that was found or given; None: far away."""
    said = work.load("lights").record["near_lamp"]
    return None if said is None else PointLight(**said)


def _seen(work: Workspace, cache: FrameCache, progress: Progress) -> tuple[Lights, PointLight | None]:
    crops, spheres = crops_of(work), spheres_of(work)
    each = []
    for number, sphere in enumerate(spheres):
        crop = crops[f"sphere-{number}"]
        camera = camera_within(work, crop)
        each.append(_of_sphere(work, cache, f"sphere-{number}", sphere.in_crop(crop.x, crop.y), camera))
        progress(number + 1, len(spheres))
    combined = merge_spheres(each, tolerance=work.parameters.lights.tolerance)
    distance = work.parameters.lights.distance
    if distance is None:
        return combined, estimate_point_light([found.half_vectors for found in each], spheres)
    pixel_size = work.load("survey").record["pixel_size"]
    if pixel_size is None:
        raise InputError(
            "the lamp's distance is given in millimetres, but nothing gives the scale",
            "give a sphere's diameter_mm, or the capture's pixel_size",
        )
    return combined, PointLight.from_distance(spheres, distance / pixel_size)


def _near_camera(work: Workspace, cache: FrameCache) -> list[str]:
    """A warning where a ball's outline shows a near camera whose matrix is not given."""
    if work.camera_matrix is not None:
        return []
    width, height = work.load("survey").record["frame_size"]
    for number, sphere in enumerate(spheres_of(work)):
        crop = crops_of(work)[f"sphere-{number}"]
        typical, brightest = levels(cache, f"sphere-{number}", shards=8)
        middle = (width - 1) / 2 - crop.x, (height - 1) / 2 - crop.y
        focal = estimate_focal_length(typical, brightest, sphere.in_crop(crop.x, crop.y), middle, width)
        if focal is not None:
            return [
                f"the ball at ({sphere.x:.0f}, {sphere.y:.0f}) is seen as an ellipse, as by a near camera with a focal"
                f" length of some {focal:.1f} frame widths: give `camera: {{matrix: ..}}`, or film from farther away"
                " with a longer lens"
            ]
    return []


def _of_sphere(work: Workspace, cache: FrameCache, name: str, sphere: Sphere, camera: np.ndarray | None) -> Lights:
    parameters = work.parameters.lights
    starts = np.arange(0, cache.frames, 64)
    chosen = starts[np.unique(np.linspace(0, len(starts) - 1, min(SAMPLED_SHARDS, len(starts))).round().astype(int))]
    every = 16 if cache.frames > 640 else 1
    sample = np.concatenate([cache.read(name, slice(start, start + 64))[::every] for start in chosen.tolist()])
    static = static_background(sample, sphere, camera=camera)
    blocks = [
        measure_highlights(
            cache.read(name, slice(start, start + BLOCK)),
            sphere,
            static,
            peak_level=parameters.seed,
            edge_level=parameters.low,
            full_level=parameters.high,
            camera=camera,
        )
        for start in range(0, cache.frames, BLOCK)
    ]
    return classify_frames(blocks, static, sphere, second_light_ratio=parameters.second, area_ratio=parameters.odd)
