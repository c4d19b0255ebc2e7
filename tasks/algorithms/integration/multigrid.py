"""Weighted Poisson equations on a pixel grid: conjugate gradients with an aggregation multigrid as preconditioner.

The multigrid aggregates blocks of 2 x 2 pixels and scales coarse corrections up (over-correction), after Braess,
Towards Algebraic Multigrid for Elliptic Problems of Second Order, Computing 55, 1995. A symmetric W-cycle with
red-black Gauss-Seidel smoothing keeps the preconditioner symmetric, as conjugate gradients require.

A grid graph is two arrays (H, W): `down[i, j] >= 0` is the weight of the edge from pixel (i, j) to (i + 1, j), and
`across[i, j] >= 0` that of the edge to (i, j + 1); the last row of `down` and the last column of `across` are zero. Its
Laplacian stays a grid Laplacian when 2 x 2 pixels become one and the weights between blocks add up, so each level is
the same two arrays, a quarter as large.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

COARSEST_SIDE_PX = 6
"""Longest side of the coarsest level, which is solved by repeated sweeps."""
COARSEST_SWEEPS = 12
"""Red-black sweeps of the coarsest level in each order of the two colours."""
OVERCORRECTION = np.float32(1.8)
"""Factor of coarse corrections: blocks are constant inside, which makes the coarse graph too stiff."""


class Hierarchy(NamedTuple):
    """The levels of a grid graph one behind the other, finest first; compiled functions take it whole.

    down, across, inverse: (N,) float32, weights and inverse diagonal of all levels, each (H + 2, W + 2) with a border
        of zeros. source, solution: (N,) float32, space for a cycle.
    start: (L + 1,) int64, where each level begins; shape: (L, 2) int64.
    """

    down: np.ndarray
    across: np.ndarray
    inverse: np.ndarray
    source: np.ndarray
    solution: np.ndarray
    start: np.ndarray
    shape: np.ndarray


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
    down, across = (np.ascontiguousarray(part, np.float64) for part in weights)
    solution = np.array(start, np.float64)
    iterations, converged = _conjugate_gradients(
        _hierarchy(down, across), down, across, np.asarray(source, np.float64), solution, tolerance, max_iterations
    )
    return solution, iterations, converged


@njit(cache=True, nogil=True)
def _conjugate_gradients(
    levels: Hierarchy,
    down: np.ndarray,
    across: np.ndarray,
    source: np.ndarray,
    x: np.ndarray,
    tolerance: float,
    max_iterations: int,
) -> tuple[int, bool]:
    """Improve x (H, W) in place by preconditioned conjugate gradients, see `solve_poisson`."""
    bound = tolerance * np.sqrt((source * source).sum())
    residual = source - _laplacian(down, across, x)
    direction, previous = np.zeros_like(x), 1.0
    for iteration in range(max_iterations + 1):
        if np.sqrt((residual * residual).sum()) <= bound:
            return iteration, True
        if iteration == max_iterations:
            break
        preconditioned = _precondition(levels, residual)
        product = (residual * preconditioned).sum()
        direction = preconditioned + (product / previous) * direction if iteration else preconditioned
        previous = product
        image = _laplacian(down, across, direction)
        step = product / (direction * image).sum()
        x += step * direction
        residual -= step * image
    return max_iterations, False


@njit(cache=True, nogil=True)
def _precondition(levels: Hierarchy, residual: np.ndarray) -> np.ndarray:
    """Return one cycle's answer (H, W) to a residual."""
    source, solution = _view(levels, levels.source, 0), _view(levels, levels.solution, 0)
    # The cycle works in single precision: scaled, so that no residual is too small for it.
    scale = np.abs(residual).max()
    source[1:-1, 1:-1] = residual / scale
    _w_cycle(levels)
    return scale * solution[1:-1, 1:-1].astype(np.float64)


def _hierarchy(down: np.ndarray, across: np.ndarray) -> Hierarchy:
    """Build the levels of the grid graph (H, W)."""
    levels = [(np.pad(down, 1).astype(np.float32), np.pad(across, 1).astype(np.float32))]
    while max(levels[-1][0].shape) - 2 > COARSEST_SIDE_PX:
        levels.append(_aggregate(*levels[-1]))
    shape = np.array([level.shape for level, _ in levels])
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
    downs, acrosses = (np.concatenate([part.ravel() for part in parts]) for parts in zip(*levels, strict=True))
    inverse = np.concatenate([_inverse_diagonal(*level).ravel() for level in levels])
    return Hierarchy(downs, acrosses, inverse, np.zeros_like(inverse), np.zeros_like(inverse), start, shape)


def _inverse_diagonal(down: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return the inverse of the Laplacian's diagonal: 0 at pixels without edges, which stay 0."""
    diagonal = down + across
    diagonal[1:] += down[:-1]
    diagonal[:, 1:] += across[:, :-1]
    return np.where(diagonal > 0.0, 1.0 / np.maximum(diagonal, np.float32(1e-30)), np.float32(0.0))


@njit(cache=True, nogil=True)
def _view(levels: Hierarchy, values: np.ndarray, depth: int) -> np.ndarray:
    """Return one level (H + 2, W + 2) of one of the hierarchy's arrays."""
    height, width = levels.shape[depth]
    return values[levels.start[depth] : levels.start[depth + 1]].reshape((height, width))


@njit(cache=True, nogil=True)
def _w_cycle(levels: Hierarchy) -> None:
    """Apply one symmetric W-cycle, started at zero, to the finest source, and leave its answer in the solution."""
    last = len(levels.shape) - 1
    left = np.zeros(last + 1, np.int64)
    depth, entered = 0, True
    # A loop instead of a recursion, which numba does not cache.
    while depth >= 0:
        if entered:
            _view(levels, levels.solution, depth)[:] = 0.0
            _smooth(levels, depth, COARSEST_SWEEPS if depth == last else 1, 0)
            # Two coarse visits on all levels but the finest, where they would cost most.
            left[depth] = 0 if depth == last else 1 if depth == 0 else 2
        else:
            correction, inverse = _view(levels, levels.solution, depth + 1), _view(levels, levels.inverse, depth)
            _add_correction(_view(levels, levels.solution, depth), correction, inverse, OVERCORRECTION)
        entered = left[depth] > 0
        if entered:
            left[depth] -= 1
            _restrict_residual(levels, depth)
            depth += 1
        else:
            # The colours are swept in reverse after the coarse correction, and half-way through the sweeps of the
            # coarsest level, which keeps the cycle symmetric.
            _smooth(levels, depth, COARSEST_SWEEPS if depth == last else 1, 1)
            depth -= 1


@njit(cache=True, nogil=True)
def _smooth(levels: Hierarchy, depth: int, sweeps: int, colour: int) -> None:
    """Sweep a level's pixels of one colour of the chequerboard, then the others, `sweeps` times."""
    down, across = _view(levels, levels.down, depth), _view(levels, levels.across, depth)
    inverse, source = _view(levels, levels.inverse, depth), _view(levels, levels.source, depth)
    for _ in range(sweeps):
        _relax(down, across, inverse, source, _view(levels, levels.solution, depth), colour)
        _relax(down, across, inverse, source, _view(levels, levels.solution, depth), 1 - colour)


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
def _restrict_residual(levels: Hierarchy, depth: int) -> None:
    """Write a level's residual source - L x, summed over blocks of 2 x 2 pixels, to the source of the next."""
    down, across = _view(levels, levels.down, depth), _view(levels, levels.across, depth)
    source, x = _view(levels, levels.source, depth), _view(levels, levels.solution, depth)
    out = _view(levels, levels.source, depth + 1)
    height, width = x.shape
    out[:] = 0.0
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            centre = x[i, j]
            flow = down[i, j] * (x[i + 1, j] - centre) + down[i - 1, j] * (x[i - 1, j] - centre)
            flow += across[i, j] * (x[i, j + 1] - centre) + across[i, j - 1] * (x[i, j - 1] - centre)
            out[(i + 1) // 2, (j + 1) // 2] += source[i, j] + flow


@njit(cache=True, nogil=True)
def _add_correction(x: np.ndarray, correction: np.ndarray, inverse: np.ndarray, scale: np.float32) -> None:
    """Add a coarse correction, constant over blocks of 2 x 2 pixels and scaled, to x in place."""
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            # Pixels without edges have no equation and stay zero.
            if inverse[i, j] > 0.0:
                x[i, j] += scale * correction[(i + 1) // 2, (j + 1) // 2]
