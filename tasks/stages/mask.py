"""Mask: the object's pixels, given or estimated."""

import numpy as np

from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.frames.mask import estimate_mask
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.frames import load_levels


def mask(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Read or estimate the mask of the region.

    Raises:
        InputError: the given mask cannot be used.
        UnusableCapture: nothing in the region looks like the object.
    """
    geometry, address = load_geometry(inputs), inputs.file("mask")
    region, (width, height) = geometry.region, geometry.frame_size
    if address is not None:
        pixels = read_mask(address, (height, width), region)
    elif "mask" in inputs.load("survey").arrays:
        pixels = inputs.load("survey").read("mask")
    else:
        background, peak = load_levels(inputs)
        spheres = [sphere.in_crop(region.x, region.y) for sphere in geometry.spheres]
        pixels = estimate_mask(background, peak, spheres=spheres)
    return StageOutput(
        arrays={"mask": pixels, "doubt": np.zeros(pixels.shape, np.float32)},
        record={"region": region.model_dump(), "estimated": address is None},
        counts={"object pixels": int(pixels.sum())},
    )
