"""What the views say of a surface: for each vertex, the normals of the views that see it, reconciled and weighed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import open3d as o3d

from glint.tasks.algorithms.multiview.view import View, sample

CLEAR = 1.5
"""Pixels by which a ray starts off the surface, so that it does not meet the surface it starts from."""
GRAZING = 0.05
"""Least cosine between normal and line of sight at which a vertex counts as seen."""
LEAST = 0.02
"""Confidence that even a guessed normal has here: where nobody knows better, the guess stands."""
POWER = 2.0
"""Power of the confidence in a normal's weight."""
ROBUST = 30.0
"""Degrees from the views' common normal at which a view's weight is halved."""


@dataclass(frozen=True, slots=True)
class Fused:
    """What the views say together of N vertices.

    normals (N, 3), of the world, unit; weight (N,) >= 0, the sum of their weights; confidence (N,) in 0..1, that of
    the best view, less where the views differ, 0 where none looks; best (N,) int, the view that says most, -1 where
    none looks. Of each view: each (V, N, 3), its normals in the world; sure (V, N), its confidence, 0 where it does
    not see the vertex.
    """

    normals: np.ndarray
    weight: np.ndarray
    confidence: np.ndarray
    best: np.ndarray
    each: np.ndarray
    sure: np.ndarray


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) of vertices (N, 3): the area-weighted mean of their triangles'."""
    corners = vertices[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], face[:, axis], len(vertices))
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def scene_of(vertices: np.ndarray, triangles: np.ndarray) -> o3d.t.geometry.RaycastingScene:
    """A mesh to cast rays at."""
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, np.float32)),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(triangles, np.uint32)),
    )
    return scene


def visible(scene: o3d.t.geometry.RaycastingScene, vertices: np.ndarray, normals: np.ndarray, view: View) -> np.ndarray:
    """Which vertices (N,) a view sees: they face it and nothing is in between."""
    towards = view.towards(vertices)
    seen = np.flatnonzero((normals * towards).sum(axis=1) > GRAZING)
    clear = CLEAR * view.footprint(vertices[seen])[:, None]
    starts = vertices[seen] + clear * (0.5 * normals[seen] + towards[seen])
    rays = np.hstack([starts, towards[seen]]).astype(np.float32)
    hidden = scene.test_occlusions(o3d.core.Tensor.from_numpy(rays)).numpy()
    found = np.zeros(len(vertices), bool)
    found[seen[~hidden]] = True
    return found


def fuse(views: Sequence[View], vertices: np.ndarray, triangles: np.ndarray) -> Fused:
    """Ask all views about the vertices (N, 3) of a mesh with triangles (M, 3)."""
    own, scene = vertex_normals(vertices, triangles), scene_of(vertices, triangles)
    each = np.zeros((len(views), *vertices.shape))
    weights, sure = np.zeros(each.shape[:2]), np.zeros(each.shape[:2])
    for number, view in enumerate(views):
        columns, rows = view.project(vertices)
        seen = visible(scene, vertices, own, view)
        seen &= sample(view.mask.astype(np.float32), columns, rows) > 0.99
        normals = view.normals_at(columns[seen], rows[seen])
        confidence = sample(np.nan_to_num(view.confidence), columns[seen], rows[seen])
        each[number, seen] = view.to_world(normals)
        sure[number, seen] = confidence
        facing = np.clip(normals[:, 2], GRAZING, 1.0)
        weights[number, seen] = np.maximum(confidence, LEAST) ** POWER * facing
    normals, agreed = _reconciled(each, weights, own)
    best = agreed.argmax(axis=0)
    kept = np.divide(agreed, weights, out=np.zeros_like(weights), where=weights > 0)
    return Fused(
        normals=normals,
        weight=agreed.sum(axis=0),
        confidence=(sure * kept).max(axis=0),
        best=np.where(agreed.max(axis=0) > 0, best, -1),
        each=each,
        sure=sure,
    )


def _reconciled(each: np.ndarray, weights: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Common normals (N, 3) of the views' (V, N, 3), and the weights (V, N) they then have: outliers count less."""
    agreed = weights
    for _ in range(3):
        total = (agreed[..., None] * each).sum(axis=0)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        common = np.where(length > 1e-9, total / np.maximum(length, 1e-9), own)
        apart = np.degrees(np.arccos(np.clip((each * common).sum(axis=-1), -1.0, 1.0)))
        agreed = weights / (1.0 + (apart / ROBUST) ** 2)
    return common, agreed
