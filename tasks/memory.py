"""Estimate the memory that a capture's stages need, from its region, frame size and length after the survey."""

from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import CaptureSize
from glint.tasks.pipeline import STAGES

LOADED_BYTES = 450 << 20
"""Memory of a worker whose libraries are loaded."""


def largest_need(context: CaptureContext) -> tuple[int, str]:
    """Return the bytes that a worker needs for the capture's largest stage, and that stage's name; after its survey."""
    survey = context.load("survey").record
    region, (width, height) = survey["region"], survey["frame_size"]
    candidates = context.parameters.clusters.clusters
    size = CaptureSize(region["width"] * region["height"], width * height, survey["bits"] // 8, candidates)
    stage = max(STAGES, key=lambda stage: stage.peak_bytes(size))
    return LOADED_BYTES + stage.peak_bytes(size), stage.name
