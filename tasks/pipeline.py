"""The stages of a capture, in the order in which they run (METHOD 1-7)."""

import numpy as np

from glint.tasks.algorithms.candidates.clusters import cluster_pixels, light_shares
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.lighting.lights import find_lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.meshing.depth_mesh import mesh_from_depth
from glint.tasks.algorithms.meshing.shading import draw_surface
from glint.tasks.engine.stage import Stage
from glint.tasks.stages.clusters import clusters
from glint.tasks.stages.depth import depth
from glint.tasks.stages.frames import frames
from glint.tasks.stages.labels import labels
from glint.tasks.stages.lights import lights
from glint.tasks.stages.markup import markup
from glint.tasks.stages.mask import mask
from glint.tasks.stages.silhouette import silhouette
from glint.tasks.stages.surface import surface
from glint.tasks.stages.survey import survey

STAGES = (
    Stage("survey", survey, facts=("spheres", "region", "pixel_size", "camera"), inputs=("frames", "mask", "lights")),
    Stage("frames", frames, needs=("survey",), version=3),
    Stage("lights", lights, needs=("frames",), inputs=("lights",), version=2),
    Stage("mask", mask, needs=("frames",), inputs=("mask",)),
    Stage("clusters", clusters, needs=("lights", "mask"), facts=("camera",), version=2),
    Stage("markup", markup, needs=("clusters",), inputs=("markup",)),
    Stage("silhouette", silhouette, needs=("mask", "markup")),
    Stage("labels", labels, needs=("clusters", "silhouette", "markup"), version=5),
    Stage("depth", depth, needs=("labels", "mask"), facts=("camera", "pixel_size")),
    Stage("surface", surface, needs=("depth", "labels", "lights")),
)
"""Survey comes first because everything is cropped by it; the object is published after its last capture."""
BY_NAME = {stage.name: stage for stage in STAGES}


def warm_up() -> None:
    """Load the compiled kernels and the libraries of all stages by a capture of a few pixels.

    A worker does it while it waits for its first task.
    """
    generator = np.random.default_rng(0)
    half_vectors = half_vectors_of(unit(np.array([0, 0, 1]) + generator.normal(0, 0.4, (40, 3)))).astype(np.float32)
    rows, columns = np.mgrid[-12:13, -12:13] / 11.0
    mask = np.hypot(rows, columns) < 1.0
    flat = np.clip(np.stack([columns, -rows], axis=-1), -0.7, 0.7)
    normals = np.concatenate([flat, np.sqrt(1.0 - (flat**2).sum(axis=-1, keepdims=True))], axis=-1)
    lit = np.linalg.norm(normals[None] - half_vectors[:, None, None], axis=-1) < 0.3
    frames = np.where(lit & mask, 250, 20).astype(np.uint8)
    find_lights(frames, Sphere(12.0, 12.0, 11.0))
    bars = np.full(mask.shape, 200, np.uint8)
    clusters = cluster_pixels(frames, bars, half_vectors, light_shares(half_vectors))
    found = reconstruct_normals(clusters, mask)
    depth = integrate(found.normals, mask, confidence=found.confidence).depth
    draw_surface(mesh_from_depth(depth, mask, found.normals, max_slope=1e3), size=16)
