"""Mask: the object's pixels, given or estimated."""

from storage.inputs import read_mask
from tasks.algorithms.mask import estimate_mask
from tasks.frames import levels, open_frames, region_of, spheres_of
from tasks.stage import Outcome, Progress
from tasks.workspace import Workspace


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
        spheres = [sphere.within(region.x, region.y) for sphere in spheres_of(work)]
        found = estimate_mask(typical, brightest, spheres=spheres)
    return Outcome(
        arrays={"mask": found},
        record={"region": region.model_dump(), "estimated": work.capture.mask is None},
        counts={"object pixels": int(found.sum())},
    )
