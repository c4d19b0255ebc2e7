"""Thresholds: the luma from which each pixel of the object counts as lit."""

from glint.tasks.algorithms.candidates.thresholds import highlight_levels
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.levels import load_levels


def thresholds(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Compute the threshold of each pixel of the region from its background level and the lights.

    Raises:
        UnusableCapture: the object has no highlight, or is saturated all the time.
    """
    (background, peak), mask = load_levels(inputs), inputs.load("mask").read("mask")
    half_vectors = inputs.load("lights").read("half_vectors")
    levels = highlight_levels(background, peak, mask, half_vectors, inputs.parameters.threshold)
    record = {"saturation_level": float(levels.saturation), "threshold": round(levels.least_rise, 4)}
    return StageOutput(arrays={"thresholds": levels.thresholds}, record=record)
