"""Weighted Poisson equations on a pixel grid: conjugate gradients with an aggregation multigrid as preconditioner.

The multigrid aggregates blocks of 2 x 2 pixels and scales coarse corrections up (over-correction), after Braess,
Towards Algebraic Multigrid for Elliptic Problems of Second Order, Computing 55, 1995. A symmetric W-cycle with
red-black Gauss-Seidel smoothing keeps the preconditioner symmetric, as conjugate gradients require.

A grid graph is two arrays (H, W): `down[i, j] >= 0` is the weight of the edge from pixel (i, j) to (i + 1, j), and
`across[i, j] >= 0` that of the edge to (i, j + 1); the last row of `down` and the last column of `across` are zero. Its
Laplacian stays a grid Laplacian when 2 x 2 pixels become one and the weights between blocks add up, so each level is
the same two arrays, a quarter as large.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse.linalg import LinearOperator, cg

COARSEST_SIDE_PX = 6
"""Longest side of the coarsest level, which is solved by repeated sweeps."""
COARSEST_SWEEPS = 12
"""Red-black sweeps of the coarsest level in each order of the two colours."""
OVERCORRECTION = np.float32(1.8)
"""Factor of coarse corrections: blocks are constant inside, which makes the coarse graph too stiff."""


@dataclass(frozen=True, slots=True)
class GridLevel:
    """A level of the hierarchy, padded by a border of zeros: weights and inverse diagonal, (H + 2, W + 2) float32."""

    down: np.ndarray
    across: np.ndarray
    inverse: np.ndarray


def solve_poisson(
    weights: np.ndarray,
    source: np.ndarray,
    start: np.ndarray,
    *,
    tolerance: float = 1e-6,
    max_iterations: int = 200,
) -> tuple[np.ndarray, int, bool]:
    """Solve L x = source, where L is the Laplacian of a grid graph.

    Args:
        weights: (2, H, W) float64 >= 0, the arrays `down` and `across` of the graph.
        source: (H, W) float64; it must sum to zero over each connected component.
        start: (H, W) float64, initial guess.
        tolerance: bound of the residual's norm relative to the source's.
        max_iterations: of conjugate gradients.

    Returns:
        The solution (H, W) float64, with an arbitrary constant on each component, which L leaves free; the number of
        iterations; and whether the tolerance was reached within the limit.
    """
    down, across = weights
    levels = _hierarchy(down, across)
    shape, size, iterations = source.shape, source.size, 0

    def laplacian(x: np.ndarray) -> np.ndarray:
        return _laplacian(down, across, x.reshape(shape)).ravel()

    def precondition(residual: np.ndarray) -> np.ndarray:
        # The cycle works in single precision: scaled, so that no residual is too small for it.
        scale = float(np.abs(residual).max()) or 1.0
        padded = np.zeros((shape[0] + 2, shape[1] + 2), np.float32)
        padded[1:-1, 1:-1] = (residual / scale).reshape(shape)
        return scale * _w_cycle(levels, 0, padded)[1:-1, 1:-1].astype(np.float64).ravel()

    def count(_: np.ndarray) -> None:
        nonlocal iterations
        iterations += 1

    solution, status = cg(
        _operator(size, laplacian),
        source.ravel(),
        x0=start.ravel(),
        rtol=tolerance,
        maxiter=max_iterations,
        M=_operator(size, precondition),
        callback=count,
    )
    return solution.reshape(shape), iterations, status == 0


def _operator(size: int, function: Callable[[np.ndarray], np.ndarray]) -> LinearOperator:
    return LinearOperator((size, size), matvec=function, dtype=np.float64)


def _hierarchy(down: np.ndarray, across: np.ndarray) -> list[GridLevel]:
    """Build the levels of the grid graph (H, W), finest first."""
    levels = [_level(np.pad(down, 1).astype(np.float32), np.pad(across, 1).astype(np.float32))]
    while max(levels[-1].down.shape) - 2 > COARSEST_SIDE_PX:
        levels.append(_level(*_aggregate(levels[-1].down, levels[-1].across)))
    return levels


def _level(down: np.ndarray, across: np.ndarray) -> GridLevel:
    """Complete a level by the inverse of the Laplacian's diagonal: 0 at pixels without edges, which stay 0."""
    diagonal = down + across
    diagonal[1:] += down[:-1]
    diagonal[:, 1:] += across[:, :-1]
    inverse = np.where(diagonal > 0.0, 1.0 / np.maximum(diagonal, np.float32(1e-30)), np.float32(0.0))
    return GridLevel(down, across, inverse)


def _w_cycle(levels: list[GridLevel], depth: int, source: np.ndarray) -> np.ndarray:
    """Apply one symmetric W-cycle, started at zero, to a padded right-hand side (H + 2, W + 2) float32."""
    level = levels[depth]
    x = np.zeros_like(source)
    # The colours are swept in one order before the coarse correction and in reverse after it, which keeps the cycle
    # symmetric; so does the reversal half-way through the sweeps of the coarsest level.
    if depth == len(levels) - 1:
        for colour in (0, 1) * COARSEST_SWEEPS + (1, 0) * COARSEST_SWEEPS:
            _relax(level.down, level.across, level.inverse, source, x, colour)
        return x
    for colour in (0, 1):
        _relax(level.down, level.across, level.inverse, source, x, colour)
    # Two coarse visits on all levels but the finest, where they would cost most.
    for _ in range(1 if depth == 0 else 2):
        coarse = _restrict_residual(level.down, level.across, source, x)
        _add_correction(x, _w_cycle(levels, depth + 1, coarse), level.inverse, OVERCORRECTION)
    for colour in (1, 0):
        _relax(level.down, level.across, level.inverse, source, x, colour)
    return x


@njit(cache=True, nogil=True)
def _aggregate(down: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the padded weights of the next coarser level: sums of the edges that run between blocks of 2 x 2."""
    height, width = down.shape[0] - 2, down.shape[1] - 2
    coarse_down = np.zeros(((height + 1) // 2 + 2, (width + 1) // 2 + 2), np.float32)
    coarse_across = np.zeros_like(coarse_down)
    for i in range(height):
        for j in range(width):
            # Edges that leave an even row or column stay inside a block and vanish.
            if i % 2 == 1:
                coarse_down[i // 2 + 1, j // 2 + 1] += down[i + 1, j + 1]
            if j % 2 == 1:
                coarse_across[i // 2 + 1, j // 2 + 1] += across[i + 1, j + 1]
    return coarse_down, coarse_across


@njit(cache=True, nogil=True)
def _laplacian(down: np.ndarray, across: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Apply the Laplacian to x (H, W) in double precision."""
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
    """Solve each pixel of one colour of the chequerboard for its neighbours, which all have the second colour."""
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1 + (i + colour) % 2, width - 1, 2):
            pull = down[i, j] * x[i + 1, j] + down[i - 1, j] * x[i - 1, j]
            pull += across[i, j] * x[i, j + 1] + across[i, j - 1] * x[i, j - 1]
            x[i, j] = (source[i, j] + pull) * inverse[i, j]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _restrict_residual(down: np.ndarray, across: np.ndarray, source: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the residual source - L x, summed over blocks of 2 x 2 pixels and padded."""
    height, width = x.shape
    out = np.zeros(((height - 1) // 2 + 2, (width - 1) // 2 + 2), np.float32)
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            centre = x[i, j]
            flow = down[i, j] * (x[i + 1, j] - centre) + down[i - 1, j] * (x[i - 1, j] - centre)
            flow += across[i, j] * (x[i, j + 1] - centre) + across[i, j - 1] * (x[i, j - 1] - centre)
            out[(i + 1) // 2, (j + 1) // 2] += source[i, j] + flow
    return out


@njit(cache=True, nogil=True)
def _add_correction(x: np.ndarray, correction: np.ndarray, inverse: np.ndarray, scale: float) -> None:
    """Add a coarse correction, constant over blocks of 2 x 2 pixels and scaled, to x in place."""
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            # Pixels without edges have no equation and stay zero.
            if inverse[i, j] > 0.0:
                x[i, j] += scale * correction[(i + 1) // 2, (j + 1) // 2]
