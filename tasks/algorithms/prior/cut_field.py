"""Smooth normal field that is cut along contours inside the silhouette: no normal influences those across a contour."""

import numpy as np
from scipy import sparse

from glint.tasks.algorithms.geometry.bilinear_grid import BilinearGrid
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.prior.smooth_normals import (
    CURVATURES,
    SLOPES,
    SmoothNormalField,
    Stencil,
    moved,
    quadratic_form,
)


def cut_field(mask: np.ndarray, right: np.ndarray, down: np.ndarray, tension_length: float) -> SmoothNormalField:
    """Return the smooth field of a mask, with a node for each pixel and no smoothness across contours.

    Args:
        mask: (H, W) bool.
        right, down: (H, W) bool, whether a contour runs between a pixel and its right neighbour, and the one below.
        tension_length: see `smooth_normal_field`.
    """
    grid = BilinearGrid.over(mask, 1)
    padding = [(0, grid.nodes.shape[axis] - mask.shape[axis]) for axis in (0, 1)]
    cuts = {(0, 1): np.pad(right, padding), (1, 0): np.pad(down, padding)}

    def form(stencil: Stencil) -> sparse.csr_matrix:
        """Return the sum of squares of a difference wherever no edge between its nodes is cut."""
        offsets = [(row, column) for row, column, _ in stencil]
        is_cut = [
            moved(cut, row, column, False)
            for row, column in offsets
            for (v, u), cut in cuts.items()
            if (row + v, column + u) in offsets
        ]
        return quadratic_form(grid.nodes, stencil, ~np.any(is_cut, axis=0))

    tension = 1.0 / max(tension_length * inradius_of(mask), 1.0) ** 2
    smoothness = tension * sum(form(stencil) for stencil in SLOPES)
    for stencil in CURVATURES:
        smoothness = smoothness + form(stencil)
    return SmoothNormalField(grid, smoothness.tocsc())
