"""Normals under a perspective camera, from those that an orthographic one would see.

A candidate normal n0 read through the sphere is the half vector of the light and V0 = (0, 0, 1). Under perspective the
pixel looks along its own ray: the same light L = 2 (n0.V0) n0 - V0 and the pixel's V give the half vector instead.
"""

import numpy as np

from tasks.algorithms.geometry import lights_of, unit


def views(camera: np.ndarray, shape: tuple[int, int], left: int, top: int) -> np.ndarray:
    """View vectors (H, W, 3), unit, from the surface to the camera, of a region whose first pixel is (left, top).

    camera (3, 3) is the matrix of the full frame in pixels.
    """
    rows, columns = np.mgrid[top : top + shape[0], left : left + shape[1]]
    rays = np.stack([columns, rows, np.ones(shape)], axis=-1) @ np.linalg.inv(camera).T
    return unit(rays * (-1.0, 1.0, 1.0))


def towards(normals: np.ndarray, camera: np.ndarray | None, left: int, top: int) -> np.ndarray:
    """Candidate normals (K, H, W, 3) float32 as the pixels' own rays make them; unchanged without a camera."""
    if camera is None:
        return normals
    here = views(camera, (normals.shape[1], normals.shape[2]), left, top)
    return unit(lights_of(normals.astype(np.float64)) + here[None]).astype(np.float32)
