"""Depth of one view, placed at the distance at which the merged model shows the surface."""

import numpy as np
from scipy import ndimage

from glint.storage.export.axes import OPENCV_FROM_CAMERA
from glint.storage.export.camera import CaptureCamera
from glint.storage.export.mesh_files import Mesh

MIN_FACING_COSINE = 0.3
"""Cosine between a vertex's normal and the direction to the camera from which the camera surely sees the vertex."""
MIN_VERTICES = 10
"""Vertices on a connected piece from which its distance is known."""


def placed_on_model(ahead: np.ndarray, camera: CaptureCamera, model: Mesh) -> np.ndarray:
    """Return distances ahead of the camera (H, W), NaN where unknown, each connected piece scaled to meet the model.

    A single view leaves the scale of each piece open. Pieces on which the model has too few vertices stay as they are.

    ahead: (H, W) of the region, in the model's unit. camera: perspective, with a pose. model: in the world frame.
    """
    assert camera.matrix is not None and camera.camera_to_world is not None
    from_world = OPENCV_FROM_CAMERA @ np.linalg.inv(camera.camera_to_world)
    points = model.vertices @ from_world[:3, :3].T + from_world[:3, 3]
    facing = -(points * (model.normals @ from_world[:3, :3].T)).sum(axis=1) / np.linalg.norm(points, axis=1)
    points = points[(facing > MIN_FACING_COSINE) & (points[:, 2] > 0)]
    pixels = points @ camera.matrix.T
    columns, rows = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int).T - [[camera.region.x], [camera.region.y]]
    inside = (rows >= 0) & (rows < ahead.shape[0]) & (columns >= 0) & (columns < ahead.shape[1])
    nearest = np.full(ahead.shape, np.inf)
    np.minimum.at(nearest, (rows[inside], columns[inside]), points[inside, 2])
    ratios = np.where(np.isfinite(nearest), nearest, np.nan) / ahead
    pieces, _ = ndimage.label(np.isfinite(ahead))
    placed = ahead.copy()
    for number, box in enumerate(ndimage.find_objects(pieces), 1):
        piece = pieces[box] == number
        known = ratios[box][piece & np.isfinite(ratios[box])]
        if known.size >= MIN_VERTICES:
            placed[box][piece] *= np.median(known)
    return placed
