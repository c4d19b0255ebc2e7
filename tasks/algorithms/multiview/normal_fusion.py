"""Fusion of the views' normals on a mesh: the robust weighted mean per vertex of the normals of all views that see it.

The mean is found by iteratively reweighted least squares with Cauchy weights (Holland and Welsch 1977).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.confidence import probability_within_tolerance
from glint.tasks.algorithms.meshing.ray_casting import RayScene
from glint.tasks.algorithms.multiview.mesh import vertex_normals
from glint.tasks.algorithms.multiview.raycast import MIN_VISIBLE_COSINE, visible
from glint.tasks.algorithms.multiview.view import View, sample

MIN_CONFIDENCE = 0.02
"""Confidence that even an extrapolated normal counts for: where no view is confident, extrapolation decides."""
CONFIDENCE_POWER = 2.0
"""Power of the confidence in the weight of a normal."""
CAUCHY_SCALE_DEG = 30.0
"""Degrees from the fused normal at which the weight of a view is halved."""
N_REWEIGHTINGS = 3
"""Iterations of the reweighting."""


@dataclass(frozen=True, slots=True)
class FusedNormals:
    """Normals of V views, fused at N vertices.

    normals (N, 3), world, unit; weight (N,) >= 0, the sum of the views' robust weights; confidence (N,) in 0..1, that
    of the best view, reduced where views disagree, 0 where no view sees the vertex; source_view (N,) int, the view of
    the largest weight, -1 where no view sees the vertex. By view: per_view (V, N, 3), its normals in the world;
    evidences, confidences (V, N), 0 where it does not see the vertex.
    """

    normals: np.ndarray
    weight: np.ndarray
    confidence: np.ndarray
    source_view: np.ndarray
    per_view: np.ndarray
    evidences: np.ndarray
    confidences: np.ndarray

    def confirmation(self, normals: np.ndarray) -> np.ndarray:
        """Return the probability (N,) that the normal of at least one view is right, and shows that `normals` are.

        normals (N, 3): of the mesh, unit. The views' normals err independently.
        """
        return np.asarray(1.0 - np.prod(1.0 - self.confidences * agreement(self.per_view, normals), axis=0))


def agreement(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the probability (...) that normals (..., 3) are right together, if one of the two is.

    The angle between them is taken for the size of an angular error with two normal components.
    """
    return probability_within_tolerance(np.radians(angles(first, second)) / np.sqrt(2.0))


def fuse_normals(views: Sequence[View], vertices: np.ndarray, triangles: np.ndarray) -> FusedNormals:
    """Fuse the normals of all views at the vertices (N, 3) of a mesh with triangles (M, 3)."""
    mesh_normals, scene = vertex_normals(vertices, triangles), RayScene((vertices, triangles))
    per_view = np.zeros((len(views), *vertices.shape))
    weights, evidences, confidences = np.zeros((3, *per_view.shape[:2]))
    for number, view in enumerate(views):
        columns, rows = view.project(vertices)
        is_seen = visible(scene, vertices, mesh_normals, view)
        # Samples across the silhouette would mix normals with the zeros outside the mask.
        is_seen &= sample(view.mask.astype(np.float32), columns, rows) > 0.99
        normals = view.normals_at(columns[is_seen], rows[is_seen])
        evidence = sample(np.nan_to_num(view.evidence), columns[is_seen], rows[is_seen])
        per_view[number, is_seen] = view.to_world(normals)
        evidences[number, is_seen] = evidence
        confidences[number, is_seen] = sample(np.nan_to_num(view.confidence), columns[is_seen], rows[is_seen])
        frontality = (per_view[number, is_seen] * view.view_vectors(vertices[is_seen])).sum(axis=1)
        cosine = np.clip(frontality, MIN_VISIBLE_COSINE, 1.0)
        weights[number, is_seen] = np.maximum(evidence, MIN_CONFIDENCE) ** CONFIDENCE_POWER * cosine
    normals, robust = _robust_mean(per_view, weights, mesh_normals)
    best = robust.argmax(axis=0)
    # The share of its weight that a view keeps tells how well it agrees with the fused normal.
    kept_share = np.divide(robust, weights, out=np.zeros_like(weights), where=weights > 0)
    return FusedNormals(
        normals=normals,
        weight=robust.sum(axis=0),
        confidence=(confidences * kept_share).max(axis=0),
        source_view=np.where(robust.max(axis=0) > 0, best, -1),
        per_view=per_view,
        evidences=evidences,
        confidences=confidences,
    )


def _robust_mean(per_view: np.ndarray, weights: np.ndarray, mesh_normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the robust mean (N, 3) of normals (V, N, 3) and their robust weights (V, N).

    Vertices without any weight keep the mesh's own normal (N, 3).
    """
    robust = weights
    for _ in range(N_REWEIGHTINGS):
        total = (robust[..., None] * per_view).sum(axis=0)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        mean = np.where(length > 1e-9, total / np.maximum(length, 1e-9), mesh_normals)
        angle = np.degrees(np.arccos(np.clip((per_view * mean).sum(axis=-1), -1.0, 1.0)))
        robust = weights / (1.0 + (angle / CAUCHY_SCALE_DEG) ** 2)
    return mean, robust
