"""Many views to one model (METHOD 8): the visual hull, sculpted until it has the normals that the views saw."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.meshing.implicit import surface_nets
from glint.tasks.algorithms.multiview.mesh_refinement import sculpt
from glint.tasks.algorithms.multiview.normal_fusion import fuse, vertex_normals
from glint.tasks.algorithms.multiview.poisson import close, reduced, tidy
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import Outline, bounding_box, hull_field, outline_of

ROUNDS = 3
"""Times that the mesh is sculpted and closed: closing takes out the folds that steps along normals leave."""
STEPS = 5
"""Steps of a round."""
MOST_VERTICES = 24_000
"""Of the mesh that is sculpted; detail below its edges comes from the last closing."""
ROUGH_VERTICES = 6_000
"""Of a rough model."""
FINEST = 1.0
"""Finest edge in pixels."""


@dataclass(frozen=True, slots=True)
class Model:
    """A closed surface in world coordinates.

    vertices (N, 3) float64 and triangles (M, 3) int64, wound outwards; normals (N, 3) unit; confidence (N,) in 0..1,
    the probability that the normal is within 5 degrees, 0 where no view saw the surface: it is the hull's guess there;
    source (N,) int: the view (its index) that says most of the vertex, -1 for none; cell: edge in world units.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    source: np.ndarray
    cell: float


def visual_hull(views: Sequence[View], outlines: Sequence[Outline], most: int = MOST_VERTICES) -> Model:
    """The hull's mesh alone, of about `most` vertices.

    Raises:
        UnusableCapture: the silhouettes have no point in common.
    """
    low, high = bounding_box(views, outlines)
    pixel = float(np.median([view.footprint((low + high)[None] / 2)[0] for view in views]))
    field = hull_field(views, outlines)
    cell = max(FINEST * pixel, float(np.prod(high - low) ** (1 / 3)) / 40.0)
    vertices, triangles = surface_nets(field, low, high, cell)
    finer = cell * np.sqrt(len(vertices) / most)
    if len(vertices) and abs(np.log(finer / cell)) > 0.1:
        cell = max(FINEST * pixel, float(finer))
        vertices, triangles = surface_nets(field, low, high, cell)
    if len(vertices) < 4:
        raise UnusableCapture("the silhouettes of the views have hardly a point in common", "check the poses")
    vertices, triangles = tidy(vertices, triangles)
    nobody = np.zeros(len(vertices))
    return Model(vertices, triangles, vertex_normals(vertices, triangles), nobody, np.full(len(vertices), -1), cell)


def merge(
    views: Sequence[View],
    start: Model | None = None,
    rounds: int = ROUNDS,
    steps: int = STEPS,
    progress: Callable[[int, int | None], None] | None = None,
) -> Model:
    """One closed surface of all views, from their visual hull or another start.

    progress: steps done, of all.

    Raises:
        UnusableCapture: the silhouettes have no point in common, or no surface is left.
    """
    outlines = [outline_of(view.mask) for view in views]
    model = start or visual_hull(views, outlines)
    vertices, triangles, done = model.vertices, model.triangles, 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, rounds * steps)

    for _ in range(rounds):
        vertices, _ = sculpt(views, outlines, vertices, triangles, steps, step)
        vertices, triangles = close(vertices, vertex_normals(vertices, triangles), model.cell)
    return _known(views, vertices, triangles, model.cell)


def rough_model(views: Sequence[View]) -> Model:
    """A quickly made model, good enough to look where other views fit it.

    Raises:
        UnusableCapture: the silhouettes have no point in common, or no surface is left.
    """
    return merge(views, visual_hull(views, [outline_of(view.mask) for view in views], ROUGH_VERTICES), rounds=1)


def simplified(model: Model, views: Sequence[View], most_triangles: int) -> Model:
    """The model with at most so many triangles."""
    vertices, triangles = reduced(model.vertices, model.triangles, most_triangles)
    return _known(views, vertices, triangles, model.cell)


def _known(views: Sequence[View], vertices: np.ndarray, triangles: np.ndarray, cell: float) -> Model:
    fused = fuse(views, vertices, triangles)
    return Model(vertices, triangles, vertex_normals(vertices, triangles), fused.confidence, fused.best, cell)
