"""Bilinear grid over a mask: values at nodes several pixels apart, fitted to pixels and interpolated between them.

The interpolation is linear, but no matrix of it is kept: of an object of millions of pixels it would have four entries
for each.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numba import njit


@dataclass(frozen=True, slots=True)
class BilinearGrid:
    """Nodes at every `step`-th pixel, as far as a pixel of the mask needs them.

    mask: (H, W) bool. step: pixels. nodes: (rows, columns) int64, numbers of the nodes from 0, -1 without.
    """

    mask: np.ndarray
    step: int
    nodes: np.ndarray

    @classmethod
    def over(cls, mask: np.ndarray, step: int) -> "BilinearGrid":
        """Return the grid over a mask (H, W) bool with a node at every `step`-th pixel."""
        nodes = np.full((mask.shape[0] // step + 2, mask.shape[1] // step + 2), -1, np.int64)
        _use_nodes(mask, step, nodes)
        nodes[nodes == 0] = np.arange((nodes == 0).sum())
        return cls(mask, step, nodes)

    @property
    def count(self) -> int:
        """Number of nodes."""
        return int(self.nodes.max()) + 1

    def normal_equations(self, values: np.ndarray, weights: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Return the matrix (nodes, nodes) and right-hand side (nodes, 2) of the weighted least-squares fit to pixels.

        values: (H, W, 2); weights: (H, W), where 0 or outside the mask a value is not read.
        """
        products, sums = _normal_equations(self.mask, self.step, self.nodes, values, weights, self.count)
        padded = np.pad(self.nodes, 1, constant_values=-1)
        height, width = self.nodes.shape
        shifts = [padded[1 + y : 1 + y + height, 1 + x : 1 + x + width] for y in (-1, 0, 1) for x in (-1, 0, 1)]
        neighbours = np.stack(shifts, axis=-1)[self.nodes >= 0]
        present = neighbours >= 0
        rows = np.concatenate([[0], np.cumsum(present.sum(axis=1))])
        return sparse.csr_matrix((products[present], neighbours[present], rows), shape=(self.count, self.count)), sums

    def interpolate(self, values: np.ndarray) -> np.ndarray:
        """Return values (nodes, 2) at all pixels (H, W, 2), 0 outside the mask."""
        return np.asarray(_interpolate(self.mask, self.step, self.nodes, np.ascontiguousarray(values)))


@njit(cache=True, nogil=True)
def _use_nodes(mask: np.ndarray, step: int, nodes: np.ndarray) -> None:
    """Set the nodes (rows, columns) that the pixels of a mask need to 0."""
    for y in range(mask.shape[0]):
        for x in range(mask.shape[1]):
            if mask[y, x]:
                for down in range(2 if y % step else 1):
                    for right in range(2 if x % step else 1):
                        nodes[y // step + down, x // step + right] = 0


@njit(cache=True, nogil=True)
def _normal_equations(
    mask: np.ndarray, step: int, nodes: np.ndarray, values: np.ndarray, weights: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of weighted products of each node's interpolation with those of its neighbours, and with values.

    The products are (nodes, 9), for the eight neighbours and the node itself in raster order; the others (nodes, 2).
    """
    products, sums = np.zeros((count, 9)), np.zeros((count, 2))
    share = np.empty((2, 2))
    for y in range(mask.shape[0]):
        for x in range(mask.shape[1]):
            weight = weights[y, x]
            if not mask[y, x] or weight == 0.0:
                continue
            row, column = y // step, x // step
            below, beside = y % step / step, x % step / step
            share[0, 0], share[0, 1] = (1.0 - below) * (1.0 - beside), (1.0 - below) * beside
            share[1, 0], share[1, 1] = below * (1.0 - beside), below * beside
            for first in range(4):
                v, u = first // 2, first % 2
                if share[v, u] == 0.0:
                    continue
                node, part = nodes[row + v, column + u], weight * share[v, u]
                sums[node, 0] += part * values[y, x, 0]
                sums[node, 1] += part * values[y, x, 1]
                for second in range(4):
                    down, right = second // 2 - v, second % 2 - u
                    products[node, 3 * down + right + 4] += part * share[second // 2, second % 2]
    return products, sums


@njit(cache=True, nogil=True)
def _interpolate(mask: np.ndarray, step: int, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    result = np.zeros((*mask.shape, 2))
    for y in range(mask.shape[0]):
        for x in range(mask.shape[1]):
            if not mask[y, x]:
                continue
            row, column = y // step, x // step
            below, beside = y % step / step, x % step / step
            for down in range(2 if below else 1):
                for right in range(2 if beside else 1):
                    part = (below if down else 1.0 - below) * (beside if right else 1.0 - beside)
                    node = nodes[row + down, column + right]
                    result[y, x, 0] += part * values[node, 0]
                    result[y, x, 1] += part * values[node, 1]
    return result
