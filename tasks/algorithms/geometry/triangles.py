"""Triangles in space."""

import numpy as np


def triangle_vectors(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the normals (M, 3) of triangles (M, 3) of vertices (N, 3), as long as twice their areas.

    They point to the side from which the corners run counter-clockwise.
    """
    corners = vertices[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
