"""The model as a view sees it: depth and normals per pixel."""

import numpy as np
import open3d as o3d
from scipy import ndimage

from glint.tasks.algorithms.multiview.normal_fusion import scene_of
from glint.tasks.algorithms.multiview.reconstruction import Model
from glint.tasks.algorithms.multiview.view import View


def cast(model: Model, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) and normals (H, W, 3) of the model at the pixels of a view's mask, NaN where it is not met.

    Depth is the camera frame's z, world units; normals are in the camera frame, unit, n_z >= 0.
    """
    rows, columns = np.nonzero(view.mask)
    starts, directions = view.rays(columns, rows)
    if view.matrix is None:
        # A ray starts in front of everything, wherever the camera frame's origin is.
        reach = np.linalg.norm(model.vertices, axis=1).max() + np.linalg.norm(view.translation)
        starts = starts - 2.0 * reach * directions
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    answer = scene_of(model.vertices, model.triangles).cast_rays(o3d.core.Tensor.from_numpy(rays))
    along = answer["t_hit"].numpy().astype(float)
    hit = np.isfinite(along)
    uv = answer["primitive_uvs"].numpy()[hit].astype(float)
    corners = model.normals[model.triangles[answer["primitive_ids"].numpy()[hit]]]
    weights = np.stack([1.0 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    met = (corners * weights[..., None]).sum(axis=1) @ view.rotation.T
    met[:, 2] = np.maximum(met[:, 2], 0.0)
    met /= np.maximum(np.linalg.norm(met, axis=1, keepdims=True), 1e-9)
    normals = np.full((*view.mask.shape, 3), np.nan, np.float32)
    depth = np.full(view.mask.shape, np.nan, np.float32)
    normals[rows[hit], columns[hit]] = met
    points = starts[hit] + along[hit, None] * directions[hit]
    depth[rows[hit], columns[hit]] = points @ view.rotation[2] + view.translation[2]
    return depth, normals


def seen_normals(model: Model, view: View) -> np.ndarray:
    """Normals (H, W, 3) float32 of the model in the camera frame, n_z >= 0, NaN outside the mask.

    Pixels of the mask that the model passes by take the nearest pixel's. From them a view's highlights are labelled
    anew.
    """
    normals = cast(model, view)[1]
    known = np.isfinite(normals[..., 0])
    if not known.any():
        return normals
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.where(view.mask[..., None], normals[tuple(nearest)], np.float32(np.nan))
