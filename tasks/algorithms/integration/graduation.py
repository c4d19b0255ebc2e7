"""Heights of a region's edges by least squares, and by a redescending loss of the misfits from a first height.

The scale of the loss falls from round to round to the noise (graduated non-convexity, Blake and Zisserman 1987), until
the height no longer changes.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.integration.edges import GridEdges, assemble
from glint.tasks.algorithms.integration.expected_rises import ExpectedRises, poisson_source, robust_weights
from glint.tasks.algorithms.integration.known_body import KnownBody, body_pull
from glint.tasks.algorithms.integration.multigrid import solve_poisson
from glint.tasks.algorithms.integration.search_limits import SearchLimits

SHRINKING = 0.7
"""Factor of the scale from round to round."""
MISFIT_SCALE = 6.0
"""Final scale of the loss, standard deviations of the expected rise."""
MIN_EDGE_WEIGHT = 1e-10
"""Weight left to an edge that is a step, as a share of the largest: the two sides stay one component."""
LEAST_SQUARES_TOLERANCE, REWEIGHTED_TOLERANCE, SETTLING_TOLERANCE = 1e-5, 1e-3, 1e-4
"""Relative residuals at which the solver stops: for least squares; for a round, which begins near its end; and for a
round at the final scale, where a height that is still far from its end would otherwise be left as it is."""


@dataclass(frozen=True, slots=True)
class Solution:
    """A height (H, W) float64, the rounds it took, and whether the last one changed it by less than the tolerance.

    follows_body: whether it follows a known body.
    """

    height: np.ndarray
    rounds: int
    converged: bool
    follows_body: bool = False


def least_squares(edges: GridEdges) -> Solution:
    """Solve for the height with all edges and both ends of each weighted alike."""
    equal = np.full(edges.forward_rise.shape, 0.5)
    weights, source = assemble(edges, equal, 0.0, 0.0, MIN_EDGE_WEIGHT)
    height, _, converged = solve_poisson(weights, source, np.zeros(source.shape), tolerance=LEAST_SQUARES_TOLERANCE)
    return Solution(height, 0, converged)


def weighted(rises: ExpectedRises, softness: np.ndarray, height: np.ndarray, tolerance: float) -> np.ndarray:
    """Solve for the height from a first one by least squares, weighted by precision and softness (2, H, W)."""
    weights = normalized(rises.precision * softness)
    return solve_poisson(weights, poisson_source(weights, rises.mean), height, tolerance=tolerance)[0]


def normalized(weights: np.ndarray) -> np.ndarray:
    """Return weights (2, H, W) in MIN_EDGE_WEIGHT..1, 0 outside the mask."""
    return np.where(weights > 0.0, np.maximum(weights / (weights.max() or 1.0), MIN_EDGE_WEIGHT), 0.0)


def graduated(
    rises: ExpectedRises,
    softness: np.ndarray,
    mask: np.ndarray,
    height: np.ndarray,
    scale: float,
    limits: SearchLimits,
    body: KnownBody | None = None,
) -> Solution:
    """Solve by a redescending loss, whose scale falls from `scale`, a number of standard deviations of the rises.

    softness: see `robust_weights`. mask: (H, W) bool. height: (H, W) in pixels, to start from. body: a known one to
    which the height is drawn.
    """
    pull = None
    for completed in range(1, limits.max_rounds + 1):
        robust = robust_weights(rises, height, softness, scale)
        weights, previous, is_final = normalized(robust), height, scale <= MISFIT_SCALE
        source = poisson_source(weights, rises.mean)
        if body is not None:
            pull = body_pull(body, height) / robust.max()
            source += pull * body.depth
        residual = SETTLING_TOLERANCE if is_final else REWEIGHTED_TOLERANCE
        height, _, solved = solve_poisson(weights, source, height, pull=pull, tolerance=residual)
        if is_final and change(height, previous, mask) <= limits.tolerance:
            return Solution(height, completed, solved)
        scale = max(scale * SHRINKING, MISFIT_SCALE)
    return Solution(height, limits.max_rounds, False)


def change(height: np.ndarray, previous: np.ndarray, mask: np.ndarray) -> float:
    """Return the root mean square difference of two heights (H, W) in a mask (H, W), pixels."""
    return float(np.sqrt(np.mean((height - previous)[mask] ** 2)))
