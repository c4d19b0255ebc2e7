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
OVERCORRECTION = np.float32(1.8)
"""Blocks are constant inside, which makes the coarse graph too stiff: its corrections are scaled up by this."""


@dataclass(frozen=True, slots=True)
class Level:
    """A level of the hierarchy, with a border of zeros: weights and inverse diagonal, each (H + 2, W + 2) float32."""

    down: np.ndarray
    across: np.ndarray
    inverse: np.ndarray


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
    levels = _hierarchy(down, across)
    shape, size, taken = source.shape, source.size, 0

    def laplacian(x: np.ndarray) -> np.ndarray:
        return _laplacian(down, across, x.reshape(shape)).ravel()

    def precondition(residual: np.ndarray) -> np.ndarray:
        # The cycle works in single precision: scaled, so that no residual is too small for it.
        scale = float(np.abs(residual).max()) or 1.0
        padded = np.zeros((shape[0] + 2, shape[1] + 2), np.float32)
        padded[1:-1, 1:-1] = (residual / scale).reshape(shape)
        return scale * _cycle(levels, 0, padded)[1:-1, 1:-1].astype(np.float64).ravel()

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


def _hierarchy(down: np.ndarray, across: np.ndarray) -> list[Level]:
    """Levels of the grid graph (H, W), the finest first."""
    levels = [_level(np.pad(down, 1).astype(np.float32), np.pad(across, 1).astype(np.float32))]
    while max(levels[-1].down.shape) - 2 > COARSEST:
        levels.append(_level(*_coarser(levels[-1].down, levels[-1].across)))
    return levels


def _level(down: np.ndarray, across: np.ndarray) -> Level:
    diagonal = down + across
    diagonal[1:] += down[:-1]
    diagonal[:, 1:] += across[:, :-1]
    return Level(down, across, np.where(diagonal > 0.0, 1.0 / np.maximum(diagonal, np.float32(1e-30)), np.float32(0.0)))


def _cycle(levels: list[Level], depth: int, source: np.ndarray) -> np.ndarray:
    """One symmetric W-cycle from zero: what the preconditioner makes of a padded residual."""
    level = levels[depth]
    x = np.zeros_like(source)
    if depth == len(levels) - 1:
        for colour in (0, 1) * 12 + (1, 0) * 12:
            _relax(level.down, level.across, level.inverse, source, x, colour)
        return x
    for colour in (0, 1):
        _relax(level.down, level.across, level.inverse, source, x, colour)
    for _ in range(1 if depth == 0 else 2):
        coarse = _restricted(level.down, level.across, source, x)
        _correct(x, _cycle(levels, depth + 1, coarse), level.inverse, OVERCORRECTION)
    for colour in (1, 0):
        _relax(level.down, level.across, level.inverse, source, x, colour)
    return x


@njit(cache=True, nogil=True)
def _coarser(down: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    height, width = down.shape[0] - 2, down.shape[1] - 2
    coarse_down = np.zeros(((height + 1) // 2 + 2, (width + 1) // 2 + 2), np.float32)
    coarse_across = np.zeros_like(coarse_down)
    for i in range(height):
        for j in range(width):
            if i % 2 == 1:
                coarse_down[i // 2 + 1, j // 2 + 1] += down[i + 1, j + 1]
            if j % 2 == 1:
                coarse_across[i // 2 + 1, j // 2 + 1] += across[i + 1, j + 1]
    return coarse_down, coarse_across


@njit(cache=True, nogil=True)
def _laplacian(down: np.ndarray, across: np.ndarray, x: np.ndarray) -> np.ndarray:
    height, width = x.shape
    out = np.zeros((height, width))
    for i in range(height):
        for j in range(width - 1):
            flow = across[i, j] * (x[i, j] - x[i, j + 1])
            out[i, j] += flow
            out[i, j + 1] -= flow
        if i + 1 < height:
            for j in range(width):
                flow = down[i, j] * (x[i, j] - x[i + 1, j])
                out[i, j] += flow
                out[i + 1, j] -= flow
    return out


@njit(cache=True, nogil=True, fastmath={"contract"})
def _relax(
    down: np.ndarray, across: np.ndarray, inverse: np.ndarray, source: np.ndarray, x: np.ndarray, colour: int
) -> None:
    """Solve each pixel of one colour of the checkerboard for its neighbours, which all have the other."""
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1 + (i + colour) % 2, width - 1, 2):
            pull = down[i, j] * x[i + 1, j] + down[i - 1, j] * x[i - 1, j]
            pull += across[i, j] * x[i, j + 1] + across[i, j - 1] * x[i, j - 1]
            x[i, j] = (source[i, j] + pull) * inverse[i, j]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _restricted(down: np.ndarray, across: np.ndarray, source: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Residual, summed over blocks of 2 x 2 pixels."""
    height, width = x.shape
    out = np.zeros(((height - 1) // 2 + 2, (width - 1) // 2 + 2), np.float32)
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            here = x[i, j]
            flow = down[i, j] * (x[i + 1, j] - here) + down[i - 1, j] * (x[i - 1, j] - here)
            flow += across[i, j] * (x[i, j + 1] - here) + across[i, j - 1] * (x[i, j - 1] - here)
            out[(i + 1) // 2, (j + 1) // 2] += source[i, j] + flow
    return out


@njit(cache=True, nogil=True)
def _correct(x: np.ndarray, correction: np.ndarray, inverse: np.ndarray, scale: float) -> None:
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            if inverse[i, j] > 0.0:
                x[i, j] += scale * correction[(i + 1) // 2, (j + 1) // 2]
