"""Survey: what the footage is, where the spheres and the object are."""

from dataclasses import asdict, dataclass

import numpy as np

from glint.storage.catalogue import loading as catalogue
from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError
from glint.storage.footage.source import Footage, open_footage
from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.frames.mask import estimate_mask
from glint.tasks.algorithms.geometry.perspective import Cone
from glint.tasks.algorithms.lighting.spheres import Sphere, find_spheres
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress

SAMPLE_BYTES = 256 << 20
"""Most bytes of full frames that are held for their median."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The full frame over time: `typical` the temporal median, `brightest` the maximum, both (H, W) float32."""

    typical: np.ndarray
    brightest: np.ndarray


def survey(work: Workspace, progress: Progress) -> Outcome:
    """Frame size and count, spheres and region, found where the catalogue does not give them; a mask found on the way.

    Raises:
        InputError: footage or mask unusable; a sphere or region outside the frame.
        UnusableCapture: no sphere or no object can be found.
    """
    capture, parameters = work.capture, work.parameters.survey
    with open_footage(capture.frames) as footage:
        size = (footage.height, footage.width)
        mask_region = _around_mask(work, size) if capture.region is None and capture.mask is not None else None
        seek_spheres = not capture.spheres and capture.lights is None
        seek_region = capture.region is None and mask_region is None
        sample = take_sample(footage, parameters.sample, progress) if seek_spheres or seek_region else None
        spheres = [Sphere(each.x, each.y, each.radius) for each in capture.spheres]
        if sample is not None and seek_spheres:
            spheres = find_spheres(sample.typical, sample.brightest, camera=work.camera_matrix)
        _check_spheres(spheres, size)
        region, arrays = capture.region or mask_region, {}
        if region is None:
            assert sample is not None
            found = estimate_mask(sample.typical, sample.brightest, spheres=spheres)
            region = around(found, 2 * parameters.margin)
            arrays = {"mask": found[region.rows, region.columns]}
        _check_region(region, size)
        scales = [_scale(each, work.camera_matrix) for each in capture.spheres if each.diameter_mm]
        pixel_size = capture.pixel_size or (float(np.mean(scales)) if scales else None)
        record = {
            "frame_size": [footage.width, footage.height],
            "frames_claimed": footage.count,
            "bits": footage.bits,
            "codec": footage.codec,
            "region": region.model_dump(),
            "spheres": [asdict(sphere) | {"found": seek_spheres} for sphere in spheres],
            "pixel_size": pixel_size,
            "unit": "pixels" if pixel_size is None else "mm",
        }
        return Outcome(arrays=arrays, record=record, counts={"spheres": len(spheres)})


def _scale(sphere: catalogue.Sphere, camera: np.ndarray | None) -> float:
    """Millimetres of a pixel at a sphere's centre, from its diameter."""
    assert sphere.diameter_mm is not None
    if camera is None:
        return sphere.diameter_mm / (2.0 * sphere.radius)
    cone = Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera)
    away = sphere.diameter_mm / (2.0 * cone.sine) * abs(float(cone.axis[2]))
    return away / float(np.sqrt(camera[0, 0] * camera[1, 1]))


def take_sample(footage: Footage, count: int, progress: Progress) -> Sample:
    """Median and maximum of about `count` frames spread over the footage; of long footage, at most so many bytes."""
    expected = footage.count or 10 * count
    step = max(1, expected // count)
    frame_bytes = footage.width * footage.height * footage.bits // 8
    held = max(5, min(count, SAMPLE_BYTES // frame_bytes))
    every = max(1, -(-(expected // step) // held))
    kept: list[np.ndarray] = []
    brightest: np.ndarray | None = None
    for number, frame in enumerate(footage.frames(step=step)):
        brightest = frame.copy() if brightest is None else np.maximum(brightest, frame, out=brightest)
        if number % every == 0:
            kept.append(frame.copy())
        progress(number * step, footage.count or None)
    if brightest is None:
        raise InputError(f"{footage.uri} holds no frame", "film or copy it again")
    scale = np.float32(1.0 if footage.bits == 8 else 1.0 / 257.0)
    return Sample(np.median(kept, axis=0).astype(np.float32) * scale, brightest.astype(np.float32) * scale)


def around(mask: np.ndarray, margin: int) -> Region:
    """The rectangle around a mask (H, W) of the full frame with so many pixels beside it, inside the frame."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    bottom = min(int(rows[-1]) + margin + 1, mask.shape[0])
    right = min(int(columns[-1]) + margin + 1, mask.shape[1])
    return Region(x=left, y=top, width=right - left, height=bottom - top)


def _around_mask(work: Workspace, size: tuple[int, int]) -> Region:
    assert work.capture.mask is not None
    return around(read_mask(work.capture.mask, size), work.parameters.survey.margin)


def _check_spheres(spheres: list[Sphere], size: tuple[int, int]) -> None:
    for sphere in spheres:
        reach = sphere.radius - 1.0
        inside = reach <= sphere.x <= size[1] - 1 - reach and reach <= sphere.y <= size[0] - 1 - reach
        if not inside:
            raise InputError(
                f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} leaves the frame of"
                f" {size[1]} x {size[0]} pixels",
                "correct it in the catalogue (pixels of the full frame, y down), or leave it out to have it found",
            )


def _check_region(region: Region, size: tuple[int, int]) -> None:
    if region.x + region.width > size[1] or region.y + region.height > size[0]:
        raise InputError(
            f"the region x {region.x} to {region.x + region.width - 1}, y {region.y} to"
            f" {region.y + region.height - 1} leaves the frame of {size[1]} x {size[0]} pixels",
            "correct it in the catalogue (pixels of the full frame), or leave it out to have it found",
        )
