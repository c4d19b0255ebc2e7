"""The ground truth of a capture, as its evaluations read it."""

from dataclasses import dataclass

import numpy as np

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.stages.capture_geometry import load_geometry


@dataclass(frozen=True, slots=True)
class CaptureTruth:
    """Ground truth of a capture's region.

    normals: (H, W, 3) float32, unit, camera frame, NaN outside the object; depth: (H, W) float32 towards the camera in
    pixels, NaN outside, None if it is not given.
    """

    normals: np.ndarray
    depth: np.ndarray | None


def load_truth(work: CaptureContext, shape: tuple[int, ...]) -> CaptureTruth | None:
    """Read the ground truth of a capture whose region has a shape (H, W); None where it has no true normals.

    Arrays of the full frame are cropped to the region.

    Raises:
        InputError: it is malformed, or of another region.
    """
    if work.capture.truth is None:
        return None
    geometry = load_geometry(work)
    truth = read_truth(work.capture.truth, shape, (geometry.frame_size[::-1], geometry.region))
    return None if truth.normals is None else CaptureTruth(truth.normals, truth.depth)
