"""Load the compiled kernels and the libraries of all stages before a worker's first task."""

from functools import cache

import numpy as np

from glint.tasks.algorithms.candidates.clusters import cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.disc_centres import DiscModel
from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.lighting.lights import USUAL_LIGHT_DEG, find_lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.meshing.depth_mesh import Surface, mesh_from_depth
from glint.tasks.algorithms.meshing.shading import draw_surface


def warm_up() -> None:
    """Run the numerics of all stages on a capture of a few pixels.

    A worker does it while it waits for its first task.
    """
    draw_surface(load_kernels(), size=16)


@cache
def load_kernels() -> Surface:
    """Run all of them but the drawing of the surface, whose library starts threads; return the mesh.

    Once in a process and those forked from it: a worker whose parent has run them only draws.
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
    highlights = HighlightLevels(np.full(mask.shape, 200, np.uint8), saturation=250.0)
    weights = inverse_density_weights(half_vectors)
    discs = DiscModel.of_light(USUAL_LIGHT_DEG, half_vectors, weights)
    clusters = cluster_pixels(frames, highlights, half_vectors, weights, discs=discs)
    result = reconstruct_normals(clusters, mask)
    depth = integrate(result.normals, mask, confidence=result.confidence).depth
    # What finds steps runs only where there are some.
    integrate(np.where(rows[..., None] < 0.0, normals, normals[:, ::-1]), mask)
    return mesh_from_depth(depth, mask, result.normals, max_slope=1e3)
