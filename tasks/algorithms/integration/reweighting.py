"""Heights of a region's edges by least squares and by iteratively reweighted least squares, and the choice among them.

The start is the masked least-squares solution, and the sides are compared by their misfits, so that both count alike on
smooth curved parts. Where large steps have bent the start all misfits are large and early decisions are wrong ones. So
two more attempts compare the publication's rises (large beyond an occluding contour) as well, or alone, with a sigmoid
that starts as flat as the largest differences require and sharpens from round to round (graduated non-convexity, Blake
and Zisserman 1987). A graduated attempt ends when the height no longer changes; clearly sparser discontinuities win
(Kim, Jung and Lee 2024). Without a step of a pixel there is nothing to attempt.
"""

import numpy as np

from glint.tasks.algorithms.integration.edges import (
    GridEdges,
    assemble,
    bilateral_weights,
    compare_sides,
    discontinuity,
)
from glint.tasks.algorithms.integration.multigrid import solve_poisson

SHARPNESS = 5.25
"""Slope of the sigmoid between a pixel's two sides where misfits are compared, per square pixel along the normal."""
GRADUATED_SHARPNESS = 2.0
"""Final slope where rises are compared too: they are larger than misfits on all slopes."""
RISE_SHARES = (0.5, 1.0)
"""Shares of the squared rise in the comparison of a pixel's sides, per graduated attempt; the rest is the squared
misfit. With 0.5 limbs before a body come free; with 1 faces with edges stay together, whose creases are no steps."""
SHARPENING = 2.0
"""Factor of the sigmoid's slope from round to round."""
UNDECIDED_SHARE = 0.999
"""Quantile of the differences between sides at which the first graduated round has the inverse of its slope."""
LEAST_STEP_PX = 1.0
"""Step, by that quantile of misfits after the first attempt, up to which no graduated attempt is made."""
LEAST_COSINE = 0.3
"""Cosine of incidence (73 degrees) from which a pixel's misfit shows a step: steeper ones misfit at every rim."""
SPARSER = 0.95
"""Ratio of the discontinuity below which a graduated attempt replaces the one that compares misfits alone."""
MISFIT_ROUNDS = 9
"""Limit of the rounds that compare misfits alone: more of them sharpen steps that the normals do not support."""
MAX_ROUNDS = 30
"""Limit of an attempt's reweighted solutions: some steps flicker between two neighbouring pixels for ever."""
TOLERANCE_PX = 5e-3
"""Root mean square change of the height in a round below which the rounds end."""
WEIGHT_POWER, RISE_POWER = 2.0, 1.0
"""Powers of that cosine with which a pixel weighs an edge, and with which the two ends' rises are averaged: at 1 the
average is the rise by the mean of the two normals, which is exact on circular arcs."""
MIN_EDGE_WEIGHT = 1e-10
"""Weight left to an edge that both its ends reject: the two sides of a step stay one component."""
LEAST_SQUARES_TOLERANCE, REWEIGHTED_TOLERANCE = 1e-5, 1e-3
"""Relative residuals at which the solver stops: for the start, and for each iteration, which begins near its end."""


def least_squares(edges: GridEdges) -> tuple[np.ndarray, bool]:
    """Solve for the height (H, W) with both ends of each edge weighted alike; return it and whether it converged."""
    equal = np.full(edges.forward_rise.shape, 0.5)
    weights, source = assemble(edges, equal, 0.0, 0.0, MIN_EDGE_WEIGHT)
    height, _, converged = solve_poisson(weights, source, np.zeros(source.shape), tolerance=LEAST_SQUARES_TOLERANCE)
    return height, converged


def robust(
    edges: GridEdges, mask: np.ndarray, sharpness: float, max_rounds: int, tolerance: float
) -> tuple[np.ndarray, int, bool]:
    """Solve for the height (H, W); return it, the rounds of all attempts, and whether its own rounds converged.

    The first attempt compares misfits alone. It is replaced where a graduated one is clearly less discontinuous, or by
    least squares, where all begin, if that is the least discontinuous.
    """
    start, solved = least_squares(edges)
    few = min(MISFIT_ROUNDS, max_rounds)
    best, rounds, converged = _reweighted(edges, mask, start, (0.0, sharpness, sharpness), few, tolerance)
    least, least_of_start = discontinuity(edges, best), discontinuity(edges, start)
    if least_of_start < least:
        best, least, converged = start, least_of_start, solved
    bound = SPARSER * least
    flat = mask & (edges.cos_incidence >= LEAST_COSINE)
    if not flat.any() or _largest(compare_sides(edges, best, 0.0)[0], flat) <= LEAST_STEP_PX**2:
        return best, rounds, converged
    for rise_share in RISE_SHARES:
        difference = compare_sides(edges, start, rise_share)[0]
        first = min(GRADUATED_SHARPNESS, 1.0 / max(_largest(difference, mask), 1e-12))
        slopes = (rise_share, first, GRADUATED_SHARPNESS)
        height, completed, ended = _reweighted(edges, mask, start, slopes, max_rounds, tolerance)
        rounds += completed
        total = discontinuity(edges, height)
        if total < bound:
            best, bound, converged = height, total, ended
    return best, rounds, converged


def _largest(difference: np.ndarray, mask: np.ndarray) -> float:
    return float(np.quantile(np.abs(difference[:, mask]), UNDECIDED_SHARE))


def _reweighted(
    edges: GridEdges,
    mask: np.ndarray,
    height: np.ndarray,
    comparison: tuple[float, float, float],
    max_rounds: int,
    tolerance: float,
) -> tuple[np.ndarray, int, bool]:
    """Solve by iteratively reweighted least squares from a height (H, W).

    `comparison` is the share of the rise and the slopes of the sigmoid in the first round and in the end. Returns the
    height, the number of rounds, and whether the last one changed it by less than the tolerance.
    """
    rise_share, slope, sharpness = comparison
    for completed in range(1, max_rounds + 1):
        shares = bilateral_weights(compare_sides(edges, height, rise_share)[0], slope)
        weights, source = assemble(edges, shares, WEIGHT_POWER, RISE_POWER, MIN_EDGE_WEIGHT)
        previous = height
        height, _, solved = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)
        change = float(np.sqrt(np.mean((height - previous)[mask] ** 2)))
        if slope >= sharpness and change <= tolerance:
            return height, completed, solved
        slope = min(slope * SHARPENING, sharpness)
    return height, max_rounds, False


def misfit_energy(edges: GridEdges, height: np.ndarray, sharpness: float) -> float:
    """Return the sum of the weighted squared misfits along the normals, square pixels."""
    difference, following, preceding = compare_sides(edges, height, 0.0)
    share = bilateral_weights(difference, sharpness)
    return float((edges.weight * (share * following + (1.0 - share) * preceding)).sum())
