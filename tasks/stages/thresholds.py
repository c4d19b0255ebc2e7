"""Thresholds: the luma from which each pixel of the object counts as lit."""

import numpy as np

from glint.tasks.algorithms.candidates.thresholds import highlight_thresholds, saturation_level
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.levels import load_levels


def thresholds(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Compute the threshold of each pixel of the region from its background level; outside the mask nothing is lit.

    Raises:
        UnusableCapture: the object has no highlight, or is saturated all the time.
    """
    (background, peak), mask = load_levels(inputs), inputs.load("mask").read("mask")
    saturation = saturation_level(peak[mask], background[mask])
    image = highlight_thresholds(background, saturation, inputs.parameters.threshold)
    image[~mask] = np.iinfo(image.dtype).max
    return StageOutput(arrays={"thresholds": image}, record={"saturation_level": float(saturation)})
