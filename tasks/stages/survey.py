"""Survey: what the video is, whether its camera stood still, where the spheres and the object are."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glint.storage.catalogue import models
from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from glint.storage.inputs.masks_and_truth import camera_matrix, read_mask
from glint.tasks.algorithms.geometry.perspective import Cone
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.parameters import SurveyParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import crops_of
from glint.tasks.stages.first_pass import Sample, SampleRecorder, discard_stored, sampled_and_stored
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, PEAK
from glint.tasks.stages.sphere_doubts import confirm_found, confirm_given
from glint.tasks.stages.stabilization import Shake, measure_shake, stabilized

SHADED_REACH = 1.1
"""Half the side of the square around a sphere in which nothing counts as standing still, in radii."""


@dataclass(frozen=True, slots=True)
class _Located:
    """What a sample of the frames shows: spheres, region, and mask (H, W) bool of the full frame where it is sought."""

    spheres: list[Sphere]
    region: Region | None
    mask: np.ndarray | None = None
    warnings: Sequence[StageWarning] = ()


def survey(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find frame size and count, the camera's shake, spheres and region, where the catalogue does not give them.

    Raises:
        InputError: the video or the mask cannot be used; a sphere or region lies outside the frame.
        UnusableCapture: no sphere or no object can be found.
    """
    parameters: SurveyParameters = inputs.parameters
    given_spheres, given_region, mask = inputs.field("spheres"), inputs.field("region"), inputs.file("mask")
    camera = camera_matrix(inputs.field("camera"))
    frames = inputs.file("frames")
    assert frames is not None
    with open_footage(frames) as footage:
        size = (footage.height, footage.width)
        mask_region = around(read_mask(mask, size), parameters.margin) if given_region is None and mask else None
        seek_spheres = not given_spheres and inputs.file("lights") is None
        seek_mask = mask is None
        needs_sample = inputs.file("lights") is None or seek_mask
        given = [Sphere(sphere.x, sphere.y, sphere.radius) for sphere in given_spheres]
        check_spheres(given, size)
        region = given_region or mask_region
        if region is not None:
            _check_region(region, size)

        def shake_of(region: Region, spheres: Sequence[Sphere]) -> Shake:
            # Whoever gives spheres or a mask has read them off the first frame.
            if not parameters.stabilize:
                return Shake({"shake_pixels": None, "applied": False})
            return measure_shake(footage, bool(given_spheres or mask), _moving_parts(region, spheres, size))

        def sampled(shake: Shake | None) -> Sample:
            # Where the camera moved, spheres and object are blurred, and beside their places in the first frame.
            source = footage if shake is None else stabilized(footage, shake.record, shake.arrays)
            return SampleRecorder(source, parameters.sample, progress).sample()

        def located(sample: Sample) -> _Located:
            spheres, mask, warnings = given, None, list[StageWarning]()
            if seek_spheres:
                detection = find_spheres(sample.frames, sample.peak, camera=camera)
                spheres, warnings = confirm_found(sample.frames, detection.spheres, camera)
                warnings += [StageWarning(sentence, "sphere") for sentence in detection.contradicting]
            elif inputs.file("lights") is None:
                spheres, warnings = confirm_given(sample.frames, given, camera)
            if seek_mask:
                mask = sample.reduced.estimate_mask(spheres, _within(region, size))
            place = around(mask, 2 * parameters.margin) if region is None and mask is not None else region
            return _Located(spheres, place, mask, warnings)

        arrays, shake, crops = dict[str, np.ndarray](), None, None
        places = _Located(given, region)
        if needs_sample and region is not None and not seek_spheres:
            shake = shake_of(region, given)
            crops = None if shake.record["applied"] else crops_of(region, given, size)
        if crops is not None:
            sample, recorded = sampled_and_stored(inputs, footage, parameters.sample, crops, progress)
            arrays |= recorded
            places = located(sample)
        elif needs_sample:
            places = located(sampled(shake))
        assert places.region is not None
        if shake is None or (not shake.record["applied"] and _circles(places.spheres) != _circles(given)):
            shake = shake_of(places.region, places.spheres)
            if needs_sample and shake.record["applied"]:
                places = located(sampled(shake))
        region, spheres = places.region, places.spheres
        assert region is not None
        if places.mask is not None:
            arrays["mask"] = places.mask[region.rows, region.columns]
        if crops is not None and (shake.record["applied"] or crops != crops_of(region, spheres, size)):
            discard_stored(inputs, crops)
            arrays = {name: array for name, array in arrays.items() if name not in (BACKGROUND, PEAK, CLIPPED)}
        record = {
            "frame_size": [footage.width, footage.height],
            "frames_claimed": footage.count,
            "bits": footage.bits,
            "codec": footage.codec,
            "region": region.model_dump(),
            "spheres": [asdict(sphere) | {"found": seek_spheres} for sphere in spheres],
            "given_spheres": [sphere.model_dump() for sphere in given_spheres],
            "camera": None if camera is None else camera.tolist(),
            "stabilization": shake.record,
            **_scale(inputs, camera),
        }
    return StageOutput(
        arrays={**arrays, **shake.arrays},
        record=record,
        counts={"spheres": len(spheres)},
        warnings=[*places.warnings, *shake.warnings],
    )


def _within(region: Region | None, size: tuple[int, int]) -> np.ndarray | None:
    """Return the pixels (H, W) bool of a region; None: no region is given."""
    if region is None:
        return None
    inside = np.zeros(size, bool)
    inside[region.rows, region.columns] = True
    return inside


def around(mask: np.ndarray, margin: int) -> Region:
    """Return the rectangle around a mask (H, W) of the full frame, `margin` pixels wider, inside the frame."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    bottom = min(int(rows[-1]) + margin + 1, mask.shape[0])
    right = min(int(columns[-1]) + margin + 1, mask.shape[1])
    return Region(x=left, y=top, width=right - left, height=bottom - top)


def _moving_parts(region: Region, spheres: Sequence[Sphere], size: tuple[int, int]) -> list[Region]:
    """Return the rectangles of object and spheres: their shading and reflections move with the light."""
    parts = [region]
    for sphere in spheres:
        reach = SHADED_REACH * sphere.radius
        left, top = max(int(sphere.x - reach), 0), max(int(sphere.y - reach), 0)
        right, bottom = min(int(sphere.x + reach) + 1, size[1]), min(int(sphere.y + reach) + 1, size[0])
        parts.append(Region(x=left, y=top, width=right - left, height=bottom - top))
    return parts


def _scale(inputs: StageInputs, camera: np.ndarray | None) -> Mapping[str, Any]:
    """Return the millimetres of a pixel and the unit of depth: as given, or from the spheres' diameters."""
    sizes = [_pixel_size(sphere, camera) for sphere in inputs.field("spheres") if sphere.diameter_mm]
    pixel_size = inputs.field("pixel_size") or (float(np.mean(sizes)) if sizes else None)
    return {"pixel_size": pixel_size, "unit": "pixels" if pixel_size is None else "mm"}


def _pixel_size(sphere: models.Sphere, camera: np.ndarray | None) -> float:
    """Return the millimetres of a pixel at a sphere's centre, from its diameter."""
    assert sphere.diameter_mm is not None
    if camera is None:
        return sphere.diameter_mm / (2.0 * sphere.radius)
    cone = Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera)
    distance = sphere.diameter_mm / (2.0 * cone.sine) * abs(float(cone.axis[2]))
    return distance / float(np.sqrt(camera[0, 0] * camera[1, 1]))


def _circles(spheres: Sequence[Sphere]) -> list[tuple[float, float, float]]:
    return [(sphere.x, sphere.y, sphere.radius) for sphere in spheres]


def check_spheres(spheres: list[Sphere], size: tuple[int, int]) -> None:
    """Check that given spheres, in pixels, lie inside a frame of `size` (rows, columns).

    Raises:
        InputError: one leaves it.
    """
    for sphere in spheres:
        reach = sphere.radius - 1.0
        inside = reach <= sphere.x <= size[1] - 1 - reach and reach <= sphere.y <= size[0] - 1 - reach
        if not inside:
            raise InputError(
                f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} leaves the frame of"
                f" {size[1]} x {size[0]} pixels",
                "correct it (pixels of the full frame, y down), or leave it out to have it found",
            )


def _check_region(region: Region, size: tuple[int, int]) -> None:
    if region.x + region.width > size[1] or region.y + region.height > size[0]:
        raise InputError(
            f"the region x {region.x} to {region.x + region.width - 1}, y {region.y} to"
            f" {region.y + region.height - 1} leaves the frame of {size[1]} x {size[0]} pixels",
            "correct it in the catalogue (pixels of the full frame), or leave it out to have it found",
        )
