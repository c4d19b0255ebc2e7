"""Weighted Poisson equations on a pixel grid: conjugate gradients with an aggregation multigrid as preconditioner.

The multigrid aggregates blocks of 2 x 2 pixels and scales coarse corrections up (over-correction), after Braess,
Towards Algebraic Multigrid for Elliptic Problems of Second Order, Computing 55, 1995. A symmetric W-cycle with
red-black Gauss-Seidel smoothing keeps the preconditioner symmetric, as conjugate gradients require.
"""

import numpy as np
from numba import njit

from glint.tasks.algorithms.integration.grid_levels import Hierarchy, hierarchy, level_view

COARSEST_SWEEPS = 12
"""Red-black sweeps of the coarsest level in each order of the two colours."""
OVERCORRECTION = np.float32(1.8)
"""Factor of coarse corrections: blocks are constant inside, which makes the coarse graph too stiff."""
UNBOUNDED_STEP = 1e8
"""Step from which a direction has no curvature but by rounding. Others are about 1, and up to 50 where edges between
two parts have 1e-10 of the largest weight."""


def solve_poisson(
    weights: np.ndarray,
    source: np.ndarray,
    start: np.ndarray,
    *,
    pull: np.ndarray | None = None,
    tolerance: float = 1e-6,
    max_iterations: int = 200,
) -> tuple[np.ndarray, int, bool]:
    """Solve (L + P) x = source, where L is the Laplacian of a grid graph and P the diagonal matrix of `pull`.

    Args:
        weights: (2, H, W) float64 >= 0, the arrays `down` and `across` of the graph, see `grid_levels`.
        source: (H, W) float64; it must sum to zero over each connected component without pull.
        start: (H, W) float64, initial guess.
        pull: (H, W) float64 >= 0, weight of each pixel's own value; None: 0.
        tolerance: bound of the residual's norm relative to the source's.
        max_iterations: of conjugate gradients.

    Returns:
        The solution (H, W) float64, with an arbitrary constant on each component without pull; the number of
        iterations; and whether the tolerance was reached within the limit.
    """
    down, across = (np.ascontiguousarray(part, np.float64) for part in weights)
    own = np.zeros(down.shape) if pull is None else np.ascontiguousarray(pull, np.float64)
    solution = np.array(start, np.float64)
    iterations, converged = _conjugate_gradients(
        hierarchy(down, across, own),
        (down, across, own),
        np.asarray(source, np.float64),
        solution,
        tolerance,
        max_iterations,
    )
    return solution, iterations, converged


@njit(cache=True, nogil=True)
def _conjugate_gradients(
    levels: Hierarchy,
    weights: tuple[np.ndarray, np.ndarray, np.ndarray],
    source: np.ndarray,
    x: np.ndarray,
    tolerance: float,
    max_iterations: int,
) -> tuple[int, bool]:
    """Improve x (H, W) in place by preconditioned conjugate gradients, see `solve_poisson`."""
    bound = tolerance * np.sqrt((source * source).sum())
    residual = source - _image(weights, x)
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
        image = _image(weights, direction)
        curvature = (direction * image).sum()
        if product >= UNBOUNDED_STEP * curvature:
            # What is left of a source that is rounding alone: a constant, which no solution reduces.
            return iteration, False
        step = product / curvature
        x += step * direction
        residual -= step * image
    return max_iterations, False


@njit(cache=True, nogil=True)
def _precondition(levels: Hierarchy, residual: np.ndarray) -> np.ndarray:
    """Return one cycle's answer (H, W) to a residual."""
    source, solution = level_view(levels, levels.source, 0), level_view(levels, levels.solution, 0)
    # The cycle works in single precision: scaled, so that no residual is too small for it.
    scale = np.abs(residual).max()
    source[1:-1, 1:-1] = residual / scale
    _w_cycle(levels)
    return scale * solution[1:-1, 1:-1].astype(np.float64)


@njit(cache=True, nogil=True)
def _w_cycle(levels: Hierarchy) -> None:
    """Apply one symmetric W-cycle, started at zero, to the finest source, and leave its answer in the solution."""
    last = len(levels.shape) - 1
    left = np.zeros(last + 1, np.int64)
    depth, entered = 0, True
    # A loop instead of a recursion, which numba does not cache.
    while depth >= 0:
        if entered:
            level_view(levels, levels.solution, depth)[:] = 0.0
            _smooth(levels, depth, COARSEST_SWEEPS if depth == last else 1, 0)
            # Two coarse visits on all levels but the finest, where they would cost most.
            left[depth] = 0 if depth == last else 1 if depth == 0 else 2
        else:
            correction, inverse = (
                level_view(levels, levels.solution, depth + 1),
                level_view(levels, levels.inverse, depth),
            )
            _add_correction(level_view(levels, levels.solution, depth), correction, inverse, OVERCORRECTION)
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
    down, across = level_view(levels, levels.down, depth), level_view(levels, levels.across, depth)
    inverse, source = level_view(levels, levels.inverse, depth), level_view(levels, levels.source, depth)
    for _ in range(sweeps):
        _relax(down, across, inverse, source, level_view(levels, levels.solution, depth), colour)
        _relax(down, across, inverse, source, level_view(levels, levels.solution, depth), 1 - colour)


@njit(cache=True, nogil=True)
def _image(weights: tuple[np.ndarray, np.ndarray, np.ndarray], x: np.ndarray) -> np.ndarray:
    """Apply Laplacian and pull to x (H, W) in double precision."""
    down, across, pull = weights
    height, width = x.shape
    out = pull * x
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
    down, across = level_view(levels, levels.down, depth), level_view(levels, levels.across, depth)
    source, x = level_view(levels, levels.source, depth), level_view(levels, levels.solution, depth)
    own = level_view(levels, levels.pull, depth)
    out = level_view(levels, levels.source, depth + 1)
    height, width = x.shape
    out[:] = 0.0
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            centre = x[i, j]
            flow = down[i, j] * (x[i + 1, j] - centre) + down[i - 1, j] * (x[i - 1, j] - centre)
            flow += across[i, j] * (x[i, j + 1] - centre) + across[i, j - 1] * (x[i, j - 1] - centre)
            out[(i + 1) // 2, (j + 1) // 2] += source[i, j] + flow - own[i, j] * centre


@njit(cache=True, nogil=True)
def _add_correction(x: np.ndarray, correction: np.ndarray, inverse: np.ndarray, scale: np.float32) -> None:
    """Add a coarse correction, constant over blocks of 2 x 2 pixels and scaled, to x in place."""
    height, width = x.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            # Pixels without edges have no equation and stay zero.
            if inverse[i, j] > 0.0:
                x[i, j] += scale * correction[(i + 1) // 2, (j + 1) // 2]
