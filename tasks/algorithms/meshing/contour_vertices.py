"""Vertices of a depth map's mesh on the occluding contour itself, at sub-pixel precision.

Centres of the outermost pixels lie about half a pixel inside the contour, on a staircase. The mesh's outermost vertices
move to the contour, and down to its height.
"""

import numpy as np

from glint.tasks.algorithms.integration.contour_margin import CONTOUR_MARGIN_PX, Contour, contour_heights


def boundary_vertices(triangles: np.ndarray) -> np.ndarray:
    """Return the sorted numbers of the vertices on edges that only one of the triangles (M, 3) has."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    # An edge as one number sorts faster than as a row.
    unique, counts = np.unique(edges[:, 0].astype(np.int64) << 32 | edges[:, 1], return_counts=True)
    once = unique[counts == 1]
    return np.unique(np.concatenate([once >> 32, once & 0xFFFFFFFF])).astype(triangles.dtype)


def moves_to_contour(
    height: np.ndarray, mask: np.ndarray, contour: Contour, vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute how boundary vertices move to the contour.

    Args:
        height: (H, W) towards the camera, in pixels.
        mask: (H, W) bool.
        contour: of the mask.
        vertices: (N,) flat numbers of pixels; those inside the margin, on steps of the surface, stay.

    Returns:
        Moves right, down and towards the camera, (N,) float64 in pixels.
    """
    level, _ = contour_heights(height, mask, contour)
    rows, columns = np.divmod(vertices, mask.shape[1])
    distance, lift = contour.distance[rows, columns], level[rows, columns] - height[rows, columns]
    moved = (distance > 0.0) & (distance < CONTOUR_MARGIN_PX) & np.isfinite(lift)
    down, right = np.where(moved, -distance, 0.0) * contour.inward[:, rows, columns]
    return right, down, np.where(moved, lift, 0.0)
