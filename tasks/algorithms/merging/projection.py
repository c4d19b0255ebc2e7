"""The model as a view sees it: its normals per pixel, from which that view's highlights are labelled anew."""

import numpy as np
import open3d as o3d
from scipy import ndimage

from tasks.algorithms.merging.fusion import scene_of
from tasks.algorithms.merging.model import Model
from tasks.algorithms.merging.views import View


def seen_normals(model: Model, view: View) -> np.ndarray:
    """Normals (H, W, 3) float32 in the camera frame, unit, n_z >= 0, NaN outside the mask.

    Pixels of the mask beside which the model passes take the nearest pixel's.
    """
    rows, columns = np.nonzero(view.mask)
    starts, directions = view.rays(columns, rows)
    if view.matrix is None:
        # A ray starts in front of everything, wherever the camera frame's origin is.
        reach = np.linalg.norm(model.vertices, axis=1).max() + np.linalg.norm(view.translation)
        starts = starts - 2.0 * reach * directions
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    answer = scene_of(model.vertices, model.triangles).cast_rays(o3d.core.Tensor.from_numpy(rays))
    hit = np.isfinite(answer["t_hit"].numpy())
    uv = answer["primitive_uvs"].numpy()[hit].astype(float)
    corners = model.normals[model.triangles[answer["primitive_ids"].numpy()[hit]]]
    weights = np.stack([1.0 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    normals = (corners * weights[..., None]).sum(axis=1) @ view.rotation.T
    normals[:, 2] = np.maximum(normals[:, 2], 0.0)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    result = np.full((*view.mask.shape, 3), np.nan, np.float32)
    result[rows[hit], columns[hit]] = normals
    if not hit.any():
        return result
    nearest = ndimage.distance_transform_edt(~np.isfinite(result[..., 0]), return_distances=False, return_indices=True)
    return np.where(view.mask[..., None], result[tuple(nearest)], np.float32(np.nan))
