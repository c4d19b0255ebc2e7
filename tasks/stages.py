"""The stages of a capture, in the order in which they run (METHOD 1-7)."""

from tasks.clusters import clusters
from tasks.depth import depth
from tasks.frames import frames
from tasks.labels import labels
from tasks.lights import lights
from tasks.markup import markup
from tasks.mask import mask
from tasks.silhouette import silhouette
from tasks.stage import Stage
from tasks.surface import surface
from tasks.survey import survey

STAGES = (
    Stage("survey", survey, facts=("spheres", "region", "pixel_size"), inputs=("frames", "mask", "lights")),
    Stage("frames", frames, needs=("survey",)),
    Stage("lights", lights, needs=("frames",), inputs=("lights",)),
    Stage("mask", mask, needs=("frames",), inputs=("mask",)),
    Stage("clusters", clusters, needs=("lights", "mask"), facts=("camera",)),
    Stage("markup", markup, needs=("clusters",), inputs=("markup",)),
    Stage("silhouette", silhouette, needs=("mask", "markup")),
    Stage("labels", labels, needs=("clusters", "silhouette", "markup")),
    Stage("depth", depth, needs=("labels", "mask"), facts=("camera", "pixel_size")),
    Stage("surface", surface, needs=("depth", "labels", "lights")),
)
"""Survey comes first because everything is cropped by it; the object is published after its last capture."""
BY_NAME = {stage.name: stage for stage in STAGES}
