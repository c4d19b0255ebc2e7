"""Smooth normal field that is cut along contours inside the silhouette: across them, no normal tells of another."""

import numpy as np
from scipy import sparse

from glint.tasks.algorithms.geometry.bilinear_grid import BilinearGrid
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.prior.smooth_normals import CURVATURES, SLOPES, SmoothNormalField, Stencil


def cut_field(mask: np.ndarray, right: np.ndarray, down: np.ndarray, tension_length: float) -> SmoothNormalField:
    """Return the smooth field of a mask, with a node for each pixel and no smoothness across contours.

    Args:
        mask: (H, W) bool.
        right, down: (H, W) bool, whether a contour runs between a pixel and its right neighbour, and the one below.
        tension_length: see `smooth_normal_field`.
    """
    grid = BilinearGrid.over(mask, 1)
    missing = [(0, grid.nodes.shape[axis] - mask.shape[axis]) for axis in (0, 1)]
    cuts = {(0, 1): np.pad(right, missing), (1, 0): np.pad(down, missing)}

    def form(stencil: Stencil) -> sparse.csr_matrix:
        """Return the sum of squares of a difference wherever all its nodes exist and no edge between them is cut."""
        offsets = [(row, column) for row, column, _ in stencil]
        complete = np.all([_moved(grid.nodes, *offset, -1) >= 0 for offset in offsets], axis=0)
        for row, column in offsets:
            for (v, u), cut in cuts.items():
                if (row + v, column + u) in offsets:
                    complete &= ~_moved(cut, row, column, False)
        count = int(complete.sum())
        columns = np.concatenate([_moved(grid.nodes, *offset, -1)[complete] for offset in offsets])
        values = np.repeat([value for *_, value in stencil], count)
        rows = np.tile(np.arange(count), len(stencil))
        difference = sparse.csr_matrix((values, (rows, columns)), shape=(count, grid.count))
        return difference.T @ difference

    tension = 1.0 / max(tension_length * inradius_of(mask), 1.0) ** 2
    smoothness = tension * sum(form(stencil) for stencil in SLOPES)
    for stencil in CURVATURES:
        smoothness = smoothness + form(stencil)
    return SmoothNormalField(grid, smoothness.tocsc())


def _moved(values: np.ndarray, down: int, right: int, fill: int) -> np.ndarray:
    """Return at each place the value (rows, columns) that lies so far below and to the right, at most a pixel."""
    padded = np.pad(values, 1, constant_values=fill)
    return padded[1 + down : 1 + down + values.shape[0], 1 + right : 1 + right + values.shape[1]]
