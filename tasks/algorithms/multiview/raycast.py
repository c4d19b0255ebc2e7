"""Ray casting at a model: which vertices a view sees, and the depth and normals that it would show."""

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.meshing.ray_casting import RayScene, interpolated
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.view import View

RAY_OFFSET_PX = 1.5
"""Pixels by which an occlusion ray starts off the surface, so that it does not hit the surface it starts from."""
MIN_VISIBLE_COSINE = 0.05
"""Smallest cosine between normal and view vector at which a vertex counts as visible."""


def visible(scene: RayScene, vertices: np.ndarray, normals: np.ndarray, view: View) -> np.ndarray:
    """Return which vertices (N,) bool face a view and are not occluded by a scene; normals (N, 3), world, unit."""
    view_vectors = view.view_vectors(vertices)
    facing = np.flatnonzero((normals * view_vectors).sum(axis=1) > MIN_VISIBLE_COSINE)
    offset = RAY_OFFSET_PX * view.footprint(vertices[facing])[:, None]
    starts = vertices[facing] + offset * (0.5 * normals[facing] + view_vectors[facing])
    is_occluded = scene.occluded(starts, view_vectors[facing])
    is_visible = np.zeros(len(vertices), bool)
    is_visible[facing[~is_occluded]] = True
    return is_visible


def raycast(model: Model, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (H, W) and normals (H, W, 3), float32, of a model at a view's pixels.

    Depth is the camera frame's z in world units; normals are in the camera frame, unit, n_z >= 0. Both are NaN outside
    the view's mask and where the ray misses the model.
    """
    rows, columns = np.nonzero(view.mask)
    starts, directions = view.rays(columns, rows)
    if view.matrix is None:
        # The camera frame's origin may lie inside the model: an orthographic ray starts outside its bounding sphere.
        reach = np.linalg.norm(model.vertices, axis=1).max() + np.linalg.norm(view.translation)
        starts = starts - 2.0 * reach * directions
    hits = RayScene((model.vertices, model.triangles)).cast(starts, directions)
    distance, is_hit = hits.distance.astype(float), hits.is_hit
    hit_normals = interpolated(model.normals, model.triangles, hits.triangle[is_hit], hits.uv[is_hit]) @ view.rotation.T
    hit_normals[:, 2] = np.maximum(hit_normals[:, 2], 0.0)
    hit_normals /= np.maximum(np.linalg.norm(hit_normals, axis=1, keepdims=True), 1e-9)
    normals = np.full((*view.mask.shape, 3), np.nan, np.float32)
    depth = np.full(view.mask.shape, np.nan, np.float32)
    normals[rows[is_hit], columns[is_hit]] = hit_normals
    points = starts[is_hit] + distance[is_hit, None] * directions[is_hit]
    depth[rows[is_hit], columns[is_hit]] = points @ view.rotation[2] + view.translation[2]
    return depth, normals


def expected_normals(model: Model, view: View) -> np.ndarray:
    """Return normals (H, W, 3) float32 of a model in the camera frame, n_z >= 0, NaN outside the view's mask.

    Pixels of the mask whose ray misses the model take the normal of the nearest pixel that hits it. The labelling of
    the view's highlights takes them as its expected field.
    """
    normals = raycast(model, view)[1]
    return with_nearest(normals, view.mask) if np.isfinite(normals[..., 0]).any() else normals
