"""The camera frame (x right, y up, z to the camera) and what normals, lights and half vectors are in it.

The view vector is V = (0, 0, 1) everywhere under the orthographic camera (paper, section 3).
"""

import numpy as np

NZ_FLOOR = 0.05
"""Least n_z used in gradients, so that rim normals (n_z = 0) keep finite ones."""


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) scaled to unit length; zero vectors become NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def half_vectors_of(lights: np.ndarray) -> np.ndarray:
    """Half vectors (..., 3) between unit light directions (..., 3) and the view vector."""
    return unit(np.asarray(lights) + np.array([0.0, 0.0, 1.0]))


def lights_of(half_vectors: np.ndarray) -> np.ndarray:
    """Light directions (..., 3) that the half vectors (..., 3) mirror into the view vector: L = 2 (n.V) n - V."""
    return 2.0 * half_vectors[..., 2:3] * half_vectors - np.array([0.0, 0.0, 1.0])


def gradients(normals: np.ndarray, floor: float = NZ_FLOOR) -> tuple[np.ndarray, np.ndarray]:
    """Gradients p = -n_x/n_z, q = -n_y/n_z of normals (..., 3), with n_z clamped from below to `floor`."""
    nz = np.maximum(normals[..., 2], floor)
    return -normals[..., 0] / nz, -normals[..., 1] / nz


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Angles in degrees between unit vectors (..., 3), accurate for small angles too."""
    return np.degrees(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(first - second, axis=-1), 0.0, 1.0)))


def to_camera(columns: np.ndarray, rows: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Camera-frame x, y (pixels) of full-frame pixel positions: the origin is the centre of the full frame."""
    return columns - (width - 1) / 2, (height - 1) / 2 - rows
