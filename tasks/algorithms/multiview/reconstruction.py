"""Multi-view reconstruction: the visual hull, refined until it has the normals of all views (the paper's future work).

Rounds of normal-guided mesh refinement (Nehab et al. 2005) alternate with screened Poisson reconstruction (Kazhdan and
Hoppe 2013), which removes the folds that steps along normals leave. From the second round on normals that the surface
contradicts lose weight.
"""

from collections.abc import Callable, Sequence

import numpy as np

from glint.tasks.algorithms.multiview.mesh import Model, decimated, vertex_normals
from glint.tasks.algorithms.multiview.mesh_refinement import refine_mesh
from glint.tasks.algorithms.multiview.normal_fusion import agreement, fuse_normals
from glint.tasks.algorithms.multiview.poisson import poisson_reconstruction
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import hull_model

REFINEMENT_ROUNDS = 3
"""Rounds of refinement and Poisson reconstruction."""
STEPS_PER_ROUND = 5
"""Refinement steps of a round."""
COARSE_VERTICES = 6_000
"""Vertices of a coarse model."""


def reconstruct_surface(
    views: Sequence[View],
    start: Model | None = None,
    rounds: int = REFINEMENT_ROUNDS,
    steps: int = STEPS_PER_ROUND,
    progress: Callable[[int, int | None], None] | None = None,
    base: float | None = None,
) -> Model:
    """Reconstruct one closed surface from all views, starting from their visual hull or from another model.

    progress(done, total): steps done, of all; base: the height y of the plane on which the object stands, if known.

    Raises:
        UnusableCapture: the silhouettes have no point in common, or no surface is left.
    """
    model = start or hull_model(views, base=base)
    vertices, triangles, steps_done = model.vertices, model.triangles, 0

    def advance() -> None:
        nonlocal steps_done
        steps_done += 1
        if progress is not None:
            progress(steps_done, rounds * steps)

    # A hull contradicts the normals wherever it is wrong: they must all move it first.
    is_robust = bool((model.source >= 0).any())
    for _ in range(rounds):
        vertices = refine_mesh(views, vertices, triangles, steps, base=base, is_robust=is_robust, progress=advance)
        is_robust = True
        vertices, triangles = poisson_reconstruction(vertices, vertex_normals(vertices, triangles), model.cell)
    return with_confidence(views, vertices, triangles, model.cell)


def coarse_model(views: Sequence[View]) -> Model:
    """Reconstruct a model quickly, good enough to search the poses of further views on it.

    Raises:
        UnusableCapture: the silhouettes have no point in common, or no surface is left.
    """
    return reconstruct_surface(views, hull_model(views, COARSE_VERTICES), rounds=1)


def simplify(model: Model, views: Sequence[View], max_triangles: int) -> Model:
    """Decimate a model to at most `max_triangles` triangles, with confidence and source of the new vertices."""
    vertices, triangles = decimated(model.vertices, model.triangles, max_triangles)
    return with_confidence(views, vertices, triangles, model.cell)


def with_confidence(
    views: Sequence[View],
    vertices: np.ndarray,
    triangles: np.ndarray,
    cell: float,
    independent: Sequence[View] | None = None,
) -> Model:
    """Return a mesh, vertices (N, 3) and triangles (M, 3), as a model with the confidence that the views give it.

    Where the mesh has not the views' normals, as behind a step or where few silhouettes hold it, theirs say little of
    its own: the angle between them is taken for the size of an angular error with two normal components.

    cell: edge in world units; independent: views whose labels do not derive from a model, where `views` do: a label
    that follows from the model is no evidence of it, so that nothing is more confident than these confirm it.
    """
    fused = fuse_normals(views, vertices, triangles)
    normals = vertex_normals(vertices, triangles)
    confidence = fused.confidence * agreement(normals, fused.normals)
    if independent is not None:
        own = fuse_normals(independent, vertices, triangles)
        confidence = np.minimum(confidence, own.confirmation(normals))
    return Model(vertices, triangles, normals, confidence, fused.source_view, cell)
