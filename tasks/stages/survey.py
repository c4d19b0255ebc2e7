"""Survey: what the video is, whether its camera stood still, where the spheres and the object are."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import Footage, open_footage
from glint.storage.inputs.masks_and_truth import camera_matrix, read_mask
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import crops_of
from glint.tasks.stages.first_pass import Sample, SampleRecorder, discard_stored, sampled_and_stored
from glint.tasks.stages.frame_parts import (
    around,
    check_camera,
    check_light_source,
    check_region,
    check_spheres,
    moving_parts,
    region_text,
    within,
)
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, PEAK
from glint.tasks.stages.scale import Scale, scale_of
from glint.tasks.stages.sphere_confirmation import confirm_found, confirm_given
from glint.tasks.stages.stabilization import Shake, changed_scene, measure_shake, stabilized


@dataclass(frozen=True, slots=True)
class _Located:
    """What a sample of the frames shows: spheres, region, and mask (H, W) bool of the full frame where it is sought.

    scene_change: share of the capture after which another scene begins, if there is one.
    """

    spheres: list[Sphere]
    region: Region | None
    mask: np.ndarray | None = None
    scene_change: float | None = None
    warnings: Sequence[StageWarning] = ()


@dataclass(frozen=True, slots=True)
class _Search:
    """What the catalogue gives of a video, and the search for the rest.

    given: its spheres; region: its region, or that around its mask; camera: matrix (3, 3).
    """

    inputs: StageInputs
    footage: Footage
    progress: Progress
    given: list[Sphere]
    region: Region | None
    camera: np.ndarray | None

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the frame."""
        return self.footage.height, self.footage.width

    @property
    def has_lights(self) -> bool:
        """Whether the catalogue gives the lights, which need no sphere."""
        return self.inputs.file("lights") is not None

    @property
    def seeks_spheres(self) -> bool:
        """Whether spheres are to be found."""
        return not self.given and not self.has_lights

    @property
    def seeks_mask(self) -> bool:
        """Whether the mask is to be estimated."""
        return self.inputs.file("mask") is None

    @property
    def needs_sample(self) -> bool:
        """Whether frames are looked at: spheres are sought or confirmed, or the mask is estimated."""
        return not self.has_lights or self.seeks_mask

    def shake(self, region: Region | None, spheres: Sequence[Sphere]) -> Shake:
        """Measure whether the camera moved, outside the region and the spheres that are known."""
        if not self.inputs.parameters.stabilize:
            return Shake({"shake_pixels": None, "applied": False})
        # Whoever gives spheres or a mask has read them off the first frame.
        to_first = bool(self.given) or not self.seeks_mask
        return measure_shake(self.footage, to_first, moving_parts(region, spheres, self.size))

    def sampled(self, shake: Shake | None) -> Sample:
        """Return a sample of the frames, moved back if they are shaken."""
        # Where the camera moved, spheres and object are blurred, and beside their places in the first frame.
        source = self.footage if shake is None else stabilized(self.footage, shake.record, shake.arrays)
        return SampleRecorder(source, self.inputs.parameters.sample, self.progress).sample()

    def located(self, sample: Sample) -> _Located:
        """Find or confirm the spheres, and estimate mask and region where they are not given.

        Raises:
            UnusableCapture: no sphere or no object can be found.
        """
        spheres, mask, warnings = self.given, None, list[StageWarning]()
        if self.seeks_spheres:
            circles = find_spheres(sample.frames, sample.peak, camera=self.camera)
            spheres, warnings = confirm_found(sample.frames, circles, self.camera)
        elif not self.has_lights:
            spheres, warnings = confirm_given(sample.frames, self.given, self.camera)
        region = self.region
        if self.seeks_mask:
            mask = self._estimated_mask(sample, spheres)
            region = region or around(mask, 2 * self.inputs.parameters.margin)
        share, changes = changed_scene(sample.frames, self.footage.count)
        return _Located(spheres, region, mask, share, [*warnings, *changes])

    def _estimated_mask(self, sample: Sample, spheres: Sequence[Sphere]) -> np.ndarray:
        """Return the mask (H, W) bool of the full frame.

        Raises:
            UnusableCapture: no object can be found, in the region if one is given.
        """
        try:
            return sample.reduced.estimate_mask(spheres, within(self.region, self.size))
        except UnusableCapture as error:
            if self.region is None:
                raise
            message = f"no object is found in {region_text(self.region)}: {error.message}"
            remedy = "correct or remove it, or paint a mask (white object on black) and name it as `mask: mask.png`"
            raise UnusableCapture(message, remedy) from error

    def first_look(self) -> tuple[_Located, Shake | None]:
        """Look at the frames as they are; if nothing is found in them and the camera moved, at frames moved back.

        Raises:
            UnusableCapture: as `located`.
        """
        try:
            return self.located(self.sampled(None)), None
        except UnusableCapture:
            shake = self.shake(self.region, self.given)
            if not shake.record["applied"]:
                raise
        return self.located(self.sampled(shake)), shake


def survey(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find frame size and count, the camera's shake, spheres and region, where the catalogue does not give them.

    Raises:
        InputError: the video or the mask cannot be used; a sphere or region lies outside the frame; spheres and lights
            are both given; the camera's matrix is not in the frame's pixels.
        UnusableCapture: no sphere or no object can be found.
    """
    frames = inputs.file("frames")
    assert frames is not None
    with open_footage(frames) as footage:
        search = _search(inputs, footage, progress)
        given, region = search.given, search.region
        arrays, crops, shake = dict[str, np.ndarray](), None, None
        places = _Located(given, region)
        if region is not None and search.needs_sample and not search.seeks_spheres:
            # Region and spheres are known: so is the shake, and, if there is none, what is to be cropped.
            shake = search.shake(region, given)
            crops = None if shake.record["applied"] else crops_of(region, given, search.size)
        if crops is not None:
            # One pass over the video samples and stores it.
            sample, recorded = sampled_and_stored(inputs, footage, inputs.parameters.sample, crops, progress)
            arrays |= recorded
            places = search.located(sample)
        elif shake is not None:
            places = search.located(search.sampled(shake))
        elif search.needs_sample:
            places, shake = search.first_look()
        # Spheres that were found, or moved, are to be left out of the shake's measurement.
        if shake is None or (not shake.record["applied"] and _circles(places.spheres) != _circles(given)):
            shake = search.shake(places.region, places.spheres)
            if search.needs_sample and shake.record["applied"]:
                places = search.located(search.sampled(shake))
        region, spheres = places.region, places.spheres
        assert region is not None
        if places.mask is not None:
            arrays["mask"] = places.mask[region.rows, region.columns]
        # What was stored on the way is of use only if the crops are as expected.
        if crops is not None and (shake.record["applied"] or crops != crops_of(region, spheres, search.size)):
            discard_stored(inputs, crops)
            arrays = {name: array for name, array in arrays.items() if name not in (BACKGROUND, PEAK, CLIPPED)}
        extent = float(max(region.width, region.height))
        scale = scale_of(inputs.field("pixel_size"), inputs.field("spheres"), spheres, search.camera, extent)
        return StageOutput(
            arrays={**arrays, **shake.arrays},
            record=_record(search, places, shake, scale),
            counts={"spheres": len(spheres)},
            warnings=[*places.warnings, *shake.warnings, *scale.warnings],
        )


def _search(inputs: StageInputs, footage: Footage, progress: Progress) -> _Search:
    """Check what the catalogue gives, and return it.

    Raises:
        InputError: as `survey`.
    """
    size, mask, region = (footage.height, footage.width), inputs.file("mask"), inputs.field("region")
    if region is None and mask:
        region = around(read_mask(mask, size), inputs.parameters.margin)
    given = [Sphere(sphere.x, sphere.y, sphere.radius) for sphere in inputs.field("spheres")]
    check_light_source(given, inputs.file("lights"))
    check_spheres(given, size)
    check_camera(inputs.field("camera"), size)
    if region is not None:
        check_region(region, size)
    return _Search(inputs, footage, progress, given, region, camera_matrix(inputs.field("camera")))


def _record(search: _Search, places: _Located, shake: Shake, scale: Scale) -> dict[str, Any]:
    """Return what is stored of a survey beside its arrays."""
    footage, inputs, camera = search.footage, search.inputs, search.camera
    assert places.region is not None
    return {
        "frame_size": [footage.width, footage.height],
        "frames_claimed": footage.count,
        "bits": footage.bits,
        "codec": footage.codec,
        "region": places.region.model_dump(),
        "spheres": [asdict(sphere) | {"found": search.seeks_spheres} for sphere in places.spheres],
        "given_spheres": [sphere.model_dump() for sphere in inputs.field("spheres")],
        "camera": None if camera is None else camera.tolist(),
        "stabilization": shake.record,
        "pixel_size": scale.pixel_size,
        "unit": scale.unit,
        "scene_change": places.scene_change,
    }


def _circles(spheres: Sequence[Sphere]) -> list[tuple[float, float, float]]:
    return [(sphere.x, sphere.y, sphere.radius) for sphere in spheres]
