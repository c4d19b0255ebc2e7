"""How far points lie outside a view's silhouette, in one pass: fits of poses ask it of millions of points."""

import numpy as np
from numba import njit

from glint.tasks.algorithms.multiview.view import MIN_DEPTH, View


def silhouette_distance(view: View, points: np.ndarray) -> np.ndarray:
    """Return the world units (...,) by which points (..., 3) lie outside a view's silhouette.

    It is `view.silhouette.distance.at(*view.project(points))` times `view.footprint(points)`.
    """
    field, is_perspective = view.silhouette.distance, view.matrix is not None
    camera = view.matrix
    if camera is None:
        scale = 1.0 / view.pixel_size
        centre = (view.frame[0] - 1) / 2, (view.frame[1] - 1) / 2
        camera = np.array([[scale, 0.0, centre[0]], [0.0, scale, centre[1]], [0.0, 0.0, 1.0]])
    margin = np.array([field.margin - view.origin[0], field.margin - view.origin[1]], float)
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    pose = np.ascontiguousarray(view.rotation), np.ascontiguousarray(view.translation)
    distance = _sampled_distances(field.distance, margin, np.ascontiguousarray(camera), is_perspective, *pose, flat)
    return np.asarray(distance).reshape(points.shape[:-1])


@njit(cache=True, nogil=True)
def _sampled_distances(
    field: np.ndarray,
    shift: np.ndarray,
    camera: np.ndarray,
    is_perspective: bool,
    rotation: np.ndarray,
    translation: np.ndarray,
    points: np.ndarray,
) -> np.ndarray:
    """Return distances (N,), world units, sampled in a field (H, W) of pixels at the projections of points (N, 3).

    shift (2,): from the frame's columns and rows to the field's; beyond its border its outermost pixels continue.
    camera (3, 3): the camera's matrix; of an orthographic one it takes the world's units to pixels.
    """
    height, width = field.shape
    focal_length = np.sqrt(camera[0, 0] * camera[1, 1])
    distances = np.empty(len(points))
    for number in range(len(points)):
        x, y, z = points[number]
        right = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]
        up = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]
        depth = 1.0
        if is_perspective:
            along = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]
            depth = max(-along, MIN_DEPTH)
        column = (camera[0, 0] * right - camera[0, 1] * up) / depth + camera[0, 2] + shift[0]
        row = -camera[1, 1] * up / depth + camera[1, 2] + shift[1]
        column, row = min(max(column, 0.0), width - 1.0), min(max(row, 0.0), height - 1.0)
        left, top = min(int(column), width - 2), min(int(row), height - 2)
        across, down = column - left, row - top
        above = field[top, left] + across * (field[top, left + 1] - field[top, left])
        below = field[top + 1, left] + across * (field[top + 1, left + 1] - field[top + 1, left])
        distances[number] = (above + down * (below - above)) * depth / focal_length
    return distances
