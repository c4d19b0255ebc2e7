"""Mask: the object's pixels, given or estimated."""

from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.frames.mask import estimate_mask
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import levels, open_frames, region_of, spheres_of


def mask(work: Workspace, progress: Progress) -> Outcome:
    """The mask of the region.

    Raises:
        InputError: the given mask is unusable.
        UnusableCapture: nothing in the region looks like the object.
    """
    region = region_of(work)
    if work.capture.mask is not None:
        width, height = work.load("survey").record["frame_size"]
        found = read_mask(work.capture.mask, (height, width), region)
    elif "mask" in work.load("survey").arrays:
        found = work.load("survey").read("mask")
    else:
        typical, brightest = levels(open_frames(work))
        spheres = [sphere.in_crop(region.x, region.y) for sphere in spheres_of(work)]
        found = estimate_mask(typical, brightest, spheres=spheres)
    return Outcome(
        arrays={"mask": found},
        record={"region": region.model_dump(), "estimated": work.capture.mask is None},
        counts={"object pixels": int(found.sum())},
    )
