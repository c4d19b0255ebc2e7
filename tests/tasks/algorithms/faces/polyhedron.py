"""A convex polyhedron with rounded edges seen from above, rendered from its planes."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera, unit

SHAPE = (160, 160)
PYRAMID = unit(np.array([[0.6, 0.5, 1.0], [-0.6, 0.5, 1.0], [0.0, -1.3, 1.0]]))
"""Normals (3, 3) of a three-sided pyramid: two faces that the light can show, and the third beyond 45 degrees."""


def polyhedron_normals(faces: np.ndarray, rounding: float = 1.0, height: float = 38.0) -> np.ndarray:
    """Return the normals (H, W, 3) of the solid above z = 0 below planes through (0, 0, height), NaN beside it.

    faces: (N, 3), unit normals. rounding: length in pixels over which an edge bends, the soft minimum's.
    """
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    slopes = -faces[:, :2] / faces[:, 2:]
    heights = height + slopes[:, 0, None, None] * x + slopes[:, 1, None, None] * y
    share = np.exp(-(heights - heights.min(axis=0)) / rounding)
    share /= share.sum(axis=0)
    p, q = np.einsum("nhw,nc->chw", share, slopes)
    normals = unit(np.stack([-p, -q, np.ones_like(p)], axis=-1))
    return np.where((heights.min(axis=0) > 0)[..., None], normals, np.nan).astype(np.float32)


def face_numbers(faces: np.ndarray) -> np.ndarray:
    """Return the number (H, W) of the face of `polyhedron_normals` at each pixel."""
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    slopes = -faces[:, :2] / faces[:, 2:]
    return np.asarray((slopes[:, 0, None, None] * x + slopes[:, 1, None, None] * y).argmin(axis=0))
