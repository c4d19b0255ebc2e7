"""Places of a capture's parts: what the catalogue gives of spheres and region, and the search for the rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import Footage
from glint.storage.inputs.masks_and_truth import camera_matrix, read_mask
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.masks.table_separation import MASK_REMEDY
from glint.tasks.engine.stage import Progress
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import crops_of
from glint.tasks.stages.first_pass import Sample, SampleRecorder, discard_stored, sampled_and_stored
from glint.tasks.stages.frame_parts import (
    around,
    check_camera,
    check_frame,
    check_light_source,
    check_region,
    check_spheres,
    moving_parts,
    region_text,
    within,
)
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, PEAK
from glint.tasks.stages.sphere_confirmation import confirm_found, confirm_given
from glint.tasks.stages.stabilization import Shake, changed_scene, measure_shake, stabilized


@dataclass(frozen=True, slots=True)
class Places:
    """What a sample of the frames shows: spheres, region, and mask (H, W) bool of the full frame where it is sought.

    scene_change: share of the capture after which another scene begins, if there is one.
    """

    spheres: list[Sphere]
    region: Region | None
    mask: np.ndarray | None = None
    scene_change: float | None = None
    warnings: Sequence[StageWarning] = ()


@dataclass(frozen=True, slots=True)
class StoredPass:
    """What a pass over the video has stored before all places were sure: crops by name, and arrays of `frames`."""

    crops: Mapping[str, Region]
    arrays: Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class PlaceSearch:
    """What the catalogue gives of a video, and the search for the rest.

    given: its spheres; region: its region, or that around its mask; camera: matrix (3, 3).
    """

    inputs: StageInputs
    footage: Footage
    progress: Progress
    given: list[Sphere]
    region: Region | None
    camera: np.ndarray | None

    @classmethod
    def of(cls, inputs: StageInputs, footage: Footage, progress: Progress) -> "PlaceSearch":
        """Check what the catalogue gives of an open video, and return the search for the rest.

        Raises:
            InputError: a sphere, the region or the mask does not fit the frame, or the frame holds no object; spheres
                and lights are both given; the camera's matrix is not in the frame's pixels.
        """
        size, mask, region = (footage.height, footage.width), inputs.file("mask"), inputs.field("region")
        check_frame(size)
        if region is None and mask:
            region = around(read_mask(mask, size), inputs.parameters.margin)
        given = [Sphere(sphere.x, sphere.y, sphere.radius) for sphere in inputs.field("spheres")]
        check_light_source(given, inputs.file("lights"))
        check_spheres(given, size)
        check_camera(inputs.field("camera"), size)
        if region is not None:
            check_region(region, size)
        return cls(inputs, footage, progress, given, region, camera_matrix(inputs.field("camera")))

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

    def located(self, sample: Sample) -> Places:
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
        return Places(spheres, region, mask, share, [*warnings, *changes])

    def _estimated_mask(self, sample: Sample, spheres: Sequence[Sphere]) -> np.ndarray:
        """Return the mask (H, W) bool of the full frame, with pixels of an object.

        Raises:
            UnusableCapture: no object can be found, in the region if one is given.
        """
        try:
            mask = sample.reduced.estimate_mask(spheres, within(self.region, self.size))
            if not mask.any():
                raise UnusableCapture("what flashes is no connected area", MASK_REMEDY)
            return mask
        except UnusableCapture as error:
            if self.region is None:
                raise
            message = f"no object is found in {region_text(self.region)}: {error.message}"
            remedy = "correct or remove it, or paint a mask (white object on black) and name it as `mask: mask.png`"
            raise UnusableCapture(message, remedy) from error

    def first_look(self) -> tuple[Places, Shake | None]:
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


def first_places(search: PlaceSearch) -> tuple[Places, Shake | None, StoredPass | None]:
    """Return what the frames show, the shake as far as it is known already, and what was stored on the way.

    Raises:
        UnusableCapture: no sphere or no object can be found.
    """
    if not search.needs_sample:
        return Places(search.given, search.region), None, None
    if search.region is None or search.seeks_spheres:
        return *search.first_look(), None
    # Region and spheres are known: so is the shake, and, if there is none, what is to be cropped.
    shake = search.shake(search.region, search.given)
    if shake.record["applied"]:
        return search.located(search.sampled(shake)), shake, None
    # One pass over the video samples and stores it.
    crops, count = crops_of(search.region, search.given, search.size), search.inputs.parameters.sample
    sample, arrays = sampled_and_stored(search.inputs, search.footage, count, crops, search.progress)
    return search.located(sample), shake, StoredPass(crops, arrays)


def useful_arrays(stored: StoredPass, search: PlaceSearch, places: Places, shake: Shake) -> dict[str, np.ndarray]:
    """Return the arrays of a pass that still hold; where a crop or the shake is another, its stored frames are removed.

    Thumbnails are of the whole frame, and hold in any case.
    """
    assert places.region is not None
    if not shake.record["applied"] and stored.crops == crops_of(places.region, places.spheres, search.size):
        return dict(stored.arrays)
    discard_stored(search.inputs, stored.crops)
    return {name: array for name, array in stored.arrays.items() if name not in (BACKGROUND, PEAK, CLIPPED)}
