"""A cylinder with flat ends before a perspective camera, by formula."""

import numpy as np

from glint.tasks.algorithms.geometry.perspective import view_vectors
from glint.tasks.algorithms.geometry.vectors import unit

SHAPE = 220, 260
CAMERA = np.array([[380.0, 0.0, 20.0], [0.0, 380.0, 60.0], [0.0, 0.0, 1.0]])
"""The object lies far beside the principal point."""
RADIUS, HALF_HEIGHT = 45.0, 60.0


def seen_cylinder(tilt: float, lean: float) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3), camera frame, and distances (H, W) along the camera's axis, NaN beside the cylinder.

    tilt, lean: of its upper end towards the camera and to the right, degrees.
    """
    upward = np.asarray(unit(np.array([np.tan(np.radians(lean)), 1.0, np.tan(np.radians(tilt))])))
    rays = -view_vectors(CAMERA, SHAPE, 0.0, 0.0)
    centre = 400.0 / -rays[110, 135, 2] * rays[110, 135]
    along, start = rays @ upward, centre @ upward
    across, offset = rays - along[..., None] * upward, centre - start * upward
    a, b = (across**2).sum(axis=-1), across @ offset
    root = b**2 - a * (offset @ offset - RADIUS**2)
    side = np.where(root > 0.0, (b - np.sqrt(np.maximum(root, 0.0))) / a, np.inf)
    side[np.abs(side * along - start) > HALF_HEIGHT] = np.inf
    distance, normals = side, np.asarray(unit(np.minimum(side, 1e4)[..., None] * across - offset))
    for sign in (-1.0, 1.0):
        end = (start + sign * HALF_HEIGHT) / along
        beside = np.linalg.norm(end[..., None] * across - offset, axis=-1)
        nearer = (beside < RADIUS) & (end > 0.0) & (end < distance) & (along * sign < 0.0)
        distance, normals = np.where(nearer, end, distance), np.where(nearer[..., None], sign * upward, normals)
    hit = np.isfinite(distance)
    return np.where(hit[..., None], normals, np.nan), np.where(hit, -rays[..., 2] * distance, np.nan)
