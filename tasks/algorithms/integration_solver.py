"""Weighted Poisson equations on a pixel grid: conjugate gradients with an aggregation multigrid as preconditioner.

A grid graph is two arrays (H, W): `down[i, j] >= 0` ties pixel (i, j) to (i + 1, j), `across[i, j] >= 0` ties it to
(i, j + 1); the last row of `down` and the last column of `across` are zero. Its Laplacian stays a grid Laplacian when
2 x 2 pixels become one and the weights between blocks add up, so each level is the same two arrays, a quarter as large.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse.linalg import LinearOperator, cg

COARSEST = 6
"""Longest side of the coarsest level, which is swept until solved."""
OVERCORRECTION = 1.8
"""Blocks are constant inside, which makes the coarse graph too stiff: its corrections are scaled up by this."""


@dataclass(frozen=True, slots=True)
class Level:
    """One level of the hierarchy: the graph's weights and the Laplacian's diagonal, each (H, W) float64."""

    across: np.ndarray
    down: np.ndarray
    diagonal: np.ndarray


def hierarchy(across: np.ndarray, down: np.ndarray) -> list[Level]:
    """Levels of the grid graph, the finest first."""
    levels = [Level(across, down, _diagonal(across, down))]
    while max(levels[-1].across.shape) > COARSEST:
        coarse_across, coarse_down = _coarsen(levels[-1].across, levels[-1].down)
        levels.append(Level(coarse_across, coarse_down, _diagonal(coarse_across, coarse_down)))
    return levels


def solve(
    weights: np.ndarray,
    source: np.ndarray,
    start: np.ndarray,
    *,
    tolerance: float = 1e-6,
    iterations: int = 200,
) -> tuple[np.ndarray, int]:
    """Solve the Laplacian of the grid graph (2, H, W: down, across) for `source` (H, W), from `start` (H, W).

    Returns the solution (H, W) and the iterations taken.
    The source must sum to zero over each connected part; each part's constant comes out as `start` and rounding leave
    it. `tolerance` bounds the residual relative to the source.
    """
    down, across = weights
    levels = hierarchy(across, down)
    shape, size, taken = source.shape, source.size, 0

    def laplacian(x: np.ndarray) -> np.ndarray:
        out = np.empty(shape)
        _apply(across, down, x.reshape(shape), out)
        return out.ravel()

    def precondition(residual: np.ndarray) -> np.ndarray:
        return _cycle(levels, 0, residual.reshape(shape)).ravel()

    def count(_: np.ndarray) -> None:
        nonlocal taken
        taken += 1

    solution, _ = cg(
        _operator(size, laplacian),
        source.ravel(),
        x0=start.ravel(),
        rtol=tolerance,
        maxiter=iterations,
        M=_operator(size, precondition),
        callback=count,
    )
    return solution.reshape(shape), taken


def _operator(size: int, function: Callable[[np.ndarray], np.ndarray]) -> LinearOperator:
    return LinearOperator((size, size), matvec=function, dtype=np.float64)


def _cycle(levels: list[Level], depth: int, source: np.ndarray) -> np.ndarray:
    """One symmetric W-cycle from zero: what the preconditioner makes of a residual."""
    level = levels[depth]
    x = np.zeros(source.shape)
    last = depth == len(levels) - 1
    for _ in range(10 if last else 1):
        _sweep(level.across, level.down, level.diagonal, source, x, True)
        if last:
            _sweep(level.across, level.down, level.diagonal, source, x, False)
    if last:
        return x
    for _ in range(1 if depth == 0 else 2):
        correction = _cycle(levels, depth + 1, _restricted_residual(level.across, level.down, source, x))
        _correct(x, correction, OVERCORRECTION)
    _sweep(level.across, level.down, level.diagonal, source, x, False)
    return x


@njit(cache=True, nogil=True)
def _diagonal(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    height, width = across.shape
    out = np.zeros((height, width))
    for i in range(height):
        for j in range(width):
            out[i, j] += across[i, j] + down[i, j]
            if j + 1 < width:
                out[i, j + 1] += across[i, j]
            if i + 1 < height:
                out[i + 1, j] += down[i, j]
    return out


@njit(cache=True, nogil=True)
def _coarsen(across: np.ndarray, down: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    height, width = across.shape
    coarse_across = np.zeros(((height + 1) // 2, (width + 1) // 2))
    coarse_down = np.zeros_like(coarse_across)
    for i in range(height):
        for j in range(width):
            if j % 2 == 1:
                coarse_across[i // 2, j // 2] += across[i, j]
            if i % 2 == 1:
                coarse_down[i // 2, j // 2] += down[i, j]
    return coarse_across, coarse_down


@njit(cache=True, nogil=True)
def _pull(across: np.ndarray, down: np.ndarray, x: np.ndarray, i: int, j: int) -> float:
    """What the neighbours of a pixel add up to, weighted."""
    height, width = x.shape
    total = 0.0
    if j + 1 < width:
        total += across[i, j] * x[i, j + 1]
    if j > 0:
        total += across[i, j - 1] * x[i, j - 1]
    if i + 1 < height:
        total += down[i, j] * x[i + 1, j]
    if i > 0:
        total += down[i - 1, j] * x[i - 1, j]
    return total


@njit(cache=True, nogil=True)
def _apply(across: np.ndarray, down: np.ndarray, x: np.ndarray, out: np.ndarray) -> None:
    height, width = x.shape
    out[:] = 0.0
    for i in range(height):
        for j in range(width):
            if across[i, j] > 0.0:
                flow = across[i, j] * (x[i, j] - x[i, j + 1])
                out[i, j] += flow
                out[i, j + 1] -= flow
            if down[i, j] > 0.0:
                flow = down[i, j] * (x[i, j] - x[i + 1, j])
                out[i, j] += flow
                out[i + 1, j] -= flow


@njit(cache=True, nogil=True)
def _sweep(
    across: np.ndarray, down: np.ndarray, diagonal: np.ndarray, source: np.ndarray, x: np.ndarray, forward: bool
) -> None:
    """Gauss-Seidel over the pixels in reading order, or backward."""
    height, width = x.shape
    size = height * width
    for step in range(size):
        place = step if forward else size - 1 - step
        i, j = place // width, place % width
        if diagonal[i, j] > 0.0:
            x[i, j] = (source[i, j] + _pull(across, down, x, i, j)) / diagonal[i, j]


@njit(cache=True, nogil=True)
def _restricted_residual(across: np.ndarray, down: np.ndarray, source: np.ndarray, x: np.ndarray) -> np.ndarray:
    height, width = x.shape
    residual = np.empty((height, width))
    _apply(across, down, x, residual)
    out = np.zeros(((height + 1) // 2, (width + 1) // 2))
    for i in range(height):
        for j in range(width):
            out[i // 2, j // 2] += source[i, j] - residual[i, j]
    return out


@njit(cache=True, nogil=True)
def _correct(x: np.ndarray, correction: np.ndarray, scale: float) -> None:
    height, width = x.shape
    for i in range(height):
        for j in range(width):
            x[i, j] += scale * correction[i // 2, j // 2]
