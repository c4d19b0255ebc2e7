"""Ray casting at a model: which vertices a view sees, and the depth and normals that it would show.

Rays are traced by Open3D's RaycastingScene (Embree: Wald, Woop, Benthin, Johnson and Ernst 2014). Open3D takes a second
to import, for which processes that only name stages need not wait.
"""

from typing import TYPE_CHECKING

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.view import View

if TYPE_CHECKING:
    import open3d as o3d

RAY_OFFSET_PX = 1.5
"""Pixels by which an occlusion ray starts off the surface, so that it does not hit the surface it starts from."""
MIN_VISIBLE_COSINE = 0.05
"""Smallest cosine between normal and view vector at which a vertex counts as visible."""


def raycasting_scene(vertices: np.ndarray, triangles: np.ndarray) -> "o3d.t.geometry.RaycastingScene":
    """Build a scene of a mesh, vertices (N, 3) and triangles (M, 3), that rays can be cast at."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, np.float32)),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(triangles, np.uint32)),
    )
    return scene


def visible(
    scene: "o3d.t.geometry.RaycastingScene", vertices: np.ndarray, normals: np.ndarray, view: View
) -> np.ndarray:
    """Return which vertices (N,) bool face a view and are not occluded; normals (N, 3) of the world, unit."""
    import open3d as o3d

    view_vectors = view.view_vectors(vertices)
    facing = np.flatnonzero((normals * view_vectors).sum(axis=1) > MIN_VISIBLE_COSINE)
    offset = RAY_OFFSET_PX * view.footprint(vertices[facing])[:, None]
    starts = vertices[facing] + offset * (0.5 * normals[facing] + view_vectors[facing])
    rays = np.hstack([starts, view_vectors[facing]]).astype(np.float32)
    is_occluded = scene.test_occlusions(o3d.core.Tensor.from_numpy(rays)).numpy()
    is_visible = np.zeros(len(vertices), bool)
    is_visible[facing[~is_occluded]] = True
    return is_visible


def raycast(model: Model, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return depth (H, W) and normals (H, W, 3), float32, of a model at a view's pixels.

    Depth is the camera frame's z in world units; normals are in the camera frame, unit, n_z >= 0. Both are NaN outside
    the view's mask and where the ray misses the model.
    """
    import open3d as o3d

    rows, columns = np.nonzero(view.mask)
    starts, directions = view.rays(columns, rows)
    if view.matrix is None:
        # The camera frame's origin may lie inside the model: an orthographic ray starts outside its bounding sphere.
        reach = np.linalg.norm(model.vertices, axis=1).max() + np.linalg.norm(view.translation)
        starts = starts - 2.0 * reach * directions
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    result = raycasting_scene(model.vertices, model.triangles).cast_rays(o3d.core.Tensor.from_numpy(rays))
    distance = result["t_hit"].numpy().astype(float)
    is_hit = np.isfinite(distance)
    # Interpolate the vertex normals by the barycentric coordinates of the hit.
    uv = result["primitive_uvs"].numpy()[is_hit].astype(float)
    corner_normals = model.normals[model.triangles[result["primitive_ids"].numpy()[is_hit]]]
    weights = np.stack([1.0 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    hit_normals = (corner_normals * weights[..., None]).sum(axis=1) @ view.rotation.T
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
