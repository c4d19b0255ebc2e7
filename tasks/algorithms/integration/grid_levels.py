"""The levels of a weighted grid graph: blocks of 2 x 2 pixels become one, and the weights between them add up.

A grid graph is three arrays (H, W): `down[i, j] >= 0` is the weight of the edge from pixel (i, j) to (i + 1, j),
`across[i, j] >= 0` that of the edge to (i, j + 1), and `pull[i, j] >= 0` that of the pixel's own value; the last row of
`down` and the last column of `across` are zero. The matrix of such a graph, its Laplacian with `pull` added to the
diagonal, stays one when weights add up, so each level is the same three arrays, a quarter as large.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

COARSEST_SIDE_PX = 6
"""Longest side of the coarsest level, which is solved by repeated sweeps."""


class Hierarchy(NamedTuple):
    """The levels of a grid graph one behind the other, finest first; compiled functions take it whole.

    down, across, pull, inverse: (N,) float32, weights and inverse diagonal of all levels, each (H + 2, W + 2) with a
        border of zeros. source, solution: (N,) float32, space for a cycle.
    start: (L + 1,) int64, where each level begins; shape: (L, 2) int64.
    """

    down: np.ndarray
    across: np.ndarray
    pull: np.ndarray
    inverse: np.ndarray
    source: np.ndarray
    solution: np.ndarray
    start: np.ndarray
    shape: np.ndarray


def hierarchy(*weights: np.ndarray) -> Hierarchy:
    """Build the levels of the grid graph (H, W) of weights down, across and pull."""
    levels = [tuple(np.pad(part, 1).astype(np.float32) for part in weights)]
    while max(levels[-1][0].shape) - 2 > COARSEST_SIDE_PX:
        levels.append(_aggregate(*levels[-1]))
    shape = np.array([level[0].shape for level in levels])
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
    downs, acrosses, pulls = (np.concatenate([part.ravel() for part in parts]) for parts in zip(*levels, strict=True))
    inverse = np.concatenate([_inverse_diagonal(*level).ravel() for level in levels])
    return Hierarchy(downs, acrosses, pulls, inverse, np.zeros_like(inverse), np.zeros_like(inverse), start, shape)


def _inverse_diagonal(down: np.ndarray, across: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """Return the inverse of the matrix' diagonal: 0 at pixels without edges and pull, which stay 0."""
    diagonal = down + across + pull
    diagonal[1:] += down[:-1]
    diagonal[:, 1:] += across[:, :-1]
    return np.where(diagonal > 0.0, 1.0 / np.maximum(diagonal, np.float32(1e-30)), np.float32(0.0))


@njit(cache=True, nogil=True)
def level_view(levels: Hierarchy, values: np.ndarray, depth: int) -> np.ndarray:
    """Return one level (H + 2, W + 2) of one of the hierarchy's arrays, `values`."""
    height, width = levels.shape[depth]
    return values[levels.start[depth] : levels.start[depth + 1]].reshape((height, width))


@njit(cache=True, nogil=True)
def _aggregate(down: np.ndarray, across: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the padded weights of the next coarser level: sums over blocks of 2 x 2, and of the edges between them."""
    height, width = down.shape[0] - 2, down.shape[1] - 2
    coarse_down = np.zeros(((height + 1) // 2 + 2, (width + 1) // 2 + 2), np.float32)
    coarse_across, coarse_pull = np.zeros_like(coarse_down), np.zeros_like(coarse_down)
    for i in range(height):
        for j in range(width):
            coarse_pull[i // 2 + 1, j // 2 + 1] += pull[i + 1, j + 1]
            # Edges that leave an even row or column stay inside a block and vanish.
            if i % 2 == 1:
                coarse_down[i // 2 + 1, j // 2 + 1] += down[i + 1, j + 1]
            if j % 2 == 1:
                coarse_across[i // 2 + 1, j // 2 + 1] += across[i + 1, j + 1]
    return coarse_down, coarse_across, coarse_pull
