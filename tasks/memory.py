"""What the stages of a capture need in memory, from its region, its frame and its length: known after the survey.

Measured with `python -m tests.benchmarks.stage_memory` on regions of 57,344 to 917,504 pixels, rounded up.
"""

from glint.tasks.engine.capture_context import Workspace
from glint.tasks.stages.clusters import TILE_BYTES

BASE = 450 << 20
"""Bytes of a worker whose libraries are loaded."""
PIXEL = {"lights": 400, "silhouette": 350, "labels": 900, "depth": 250, "surface": 450}
"""Bytes per pixel of the region at a stage's peak."""
SHARDS = 5
"""Shards of 64 frames that are there while frames are decoded, compressed and written."""
CLUSTER_BYTES = 3 * TILE_BYTES
"""A tile's frames, and what is collected from them."""


def largest_need(work: Workspace) -> tuple[int, str]:
    """Bytes that a worker needs for the capture's largest stage, and that stage's name; after its survey."""
    survey = work.load("survey").record
    region, (width, height), wide = survey["region"], survey["frame_size"], survey["bits"] // 8
    pixels = region["width"] * region["height"]
    needs = {stage: each * pixels for stage, each in PIXEL.items()}
    needs |= {"frames": (SHARDS * 64 * pixels + 8 * width * height) * wide, "clusters": CLUSTER_BYTES}
    stage = max(needs, key=needs.__getitem__)
    return BASE + needs[stage], stage
