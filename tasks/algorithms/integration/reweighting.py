"""Heights of a region's edges by least squares and by iteratively reweighted least squares, and the choice among them.

Weighted by the precision of the expected rises alone, least squares is right where the surface is continuous; if no
misfit exceeds the noise there is nothing else to do. Otherwise some edges are steps, and which ones is no convex
problem. Three attempts start differently: two where the two sides of each pixel are compared (bilateral), which sees
occluding contours; one from evidence in the normals, which sees steps that fade out of a slope. Each ends in the same
problem, a redescending loss of the misfits whose scale falls from round to round to the noise (graduated non-convexity,
Blake and Zisserman 1987), until the height no longer changes. All prefer steps whose near side tilts towards the far
one, and the attempt whose steps are shortest, weighted by that, wins.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.integration.edges import (
    GridEdges,
    assemble,
    bilateral_weights,
    compare_sides,
    step_price,
)
from glint.tasks.algorithms.integration.expected_rises import (
    ExpectedRises,
    curl_evidence,
    expected_rises,
    normal_evidence,
    poisson_source,
    robust_weights,
)
from glint.tasks.algorithms.integration.multigrid import solve_poisson

SHARPNESS = 2.0
"""Final slope of the sigmoid between a pixel's two sides, per square pixel along the normal."""
BILATERAL_STARTS = (0.5, 0.0), (1.0, 1.5)
"""Share of the squared rise in the comparison of a pixel's sides, and power of the tilt, per bilateral start; the rest
of the share is the squared misfit. With 0.5 limbs before a body come free; with 1 faces with edges stay together, whose
creases are no steps."""
TILT_POWER = 0.8
"""A step costs its length in pixels over exp(this x tilt of the near side towards the far one): steps that something
hides behind are cheap, and those to which the near side turns its back are dear."""
SHARPENING = 2.0
"""Factor of the sigmoid's slope from round to round."""
BILATERAL_ROUNDS = 20
"""Limit of the rounds of a bilateral start: it need not converge."""
LARGEST_SHARE = 0.999
"""Quantile of the differences between sides at which the first bilateral round has the inverse of its slope."""
MISFIT_SCALE = 6.0
"""Final scale of the loss, standard deviations of the expected rise."""
NOISE_SCALE = 4.0
"""Largest misfit, in the same unit, up to which a continuous surface explains the normals."""
BILATERAL_SCALE = 10.0
"""First scale after a bilateral start: its own steps have no weight, and what it got wrong may still be mended."""
SHRINKING = 0.7
"""Factor of the scale from round to round."""
EVIDENCE_SCALE = 3.0
"""Significance of a step's evidence at which its scale falls, or its weight, to half."""
CONTOUR_LENGTHS, LINE_LENGTHS = (2,), (2, 4, 8, 16)
"""Squares on both sides of an edge over which curl is summed: after a bilateral start short lines, which follow
contours; else long ones too, which see straight steps through noise, and changes of the normal."""
CONTOUR_POWER, LINE_POWER = 1.0, 2.0
"""Powers of the fall of the weight with that evidence."""
MAX_ROUNDS = 30
"""Limit of an attempt's reweighted solutions."""
TOLERANCE_PX = 5e-3
"""Root mean square change of the height in a round below which the rounds end."""
WEIGHT_POWER, RISE_POWER = 2.0, 1.0
"""Powers of the cosine of incidence with which a pixel weighs an edge in a bilateral start, and with which the rises of
the two ends are averaged: at 1 the average is the rise by the mean of the two normals, exact on circular arcs."""
MIN_EDGE_WEIGHT = 1e-10
"""Weight left to an edge that is a step, as a share of the largest: the two sides stay one component."""
LEAST_SQUARES_TOLERANCE, REWEIGHTED_TOLERANCE = 1e-5, 1e-3
"""Relative residuals at which the solver stops: for least squares, and for each round, which begins near its end."""


@dataclass(frozen=True, slots=True)
class Solution:
    """A height (H, W) float64, the rounds it took, and whether the last one changed it by less than the tolerance."""

    height: np.ndarray
    rounds: int
    converged: bool


def least_squares(edges: GridEdges) -> Solution:
    """Solve for the height with all edges and both ends of each weighted alike."""
    equal = np.full(edges.forward_rise.shape, 0.5)
    weights, source = assemble(edges, equal, 0.0, 0.0, MIN_EDGE_WEIGHT)
    height, _, converged = solve_poisson(weights, source, np.zeros(source.shape), tolerance=LEAST_SQUARES_TOLERANCE)
    return Solution(height, 0, converged)


def robust(edges: GridEdges, mask: np.ndarray, sharpness: float, max_rounds: int, tolerance: float) -> Solution:
    """Solve for the height with steps where the normals require them; `rounds` are those of all attempts."""
    rises = expected_rises(edges)
    plain = least_squares(edges)
    even = np.ones((2, *rises.mean.shape))
    start = _weighted(rises, even[0], plain.height, LEAST_SQUARES_TOLERANCE)
    if _largest_misfit(rises, start) <= NOISE_SCALE:
        return _graduated(rises, even, mask, start, MISFIT_SCALE, max_rounds, tolerance)
    best, lowest, rounds = plain, step_price(edges, plain.height, TILT_POWER), 0
    for attempt in _attempts(edges, rises, mask, plain.height, (sharpness, max_rounds, tolerance)):
        price = step_price(edges, attempt.height, TILT_POWER)
        rounds += attempt.rounds
        if price < lowest:
            best, lowest = attempt, price
    return Solution(best.height, rounds, best.converged)


def refined(edges: GridEdges, mask: np.ndarray, height: np.ndarray, max_rounds: int, tolerance: float) -> Solution:
    """Solve for the height as `robust`, but from one start: a height of a coarser grid, whose steps it keeps."""
    rises = expected_rises(edges)
    plain = least_squares(edges)
    even = np.ones((2, *rises.mean.shape))
    start = _weighted(rises, even[0], plain.height, LEAST_SQUARES_TOLERANCE)
    if _largest_misfit(rises, start) <= NOISE_SCALE:
        return _graduated(rises, even, mask, start, MISFIT_SCALE, max_rounds, tolerance)
    softness = _contour_softness(edges, rises)
    solution = _graduated(rises, softness, mask, height, BILATERAL_SCALE, max_rounds, tolerance)
    return min(plain, solution, key=lambda choice: step_price(edges, choice.height, TILT_POWER))


def _contour_softness(edges: GridEdges, rises: ExpectedRises) -> np.ndarray:
    return _step_prices(edges, _softness(curl_evidence(edges, rises, CONTOUR_LENGTHS), CONTOUR_POWER))


def _softness(evidence: np.ndarray, power: float) -> np.ndarray:
    return np.asarray((1.0 + evidence / EVIDENCE_SCALE**2) ** -power)


def _step_prices(edges: GridEdges, softness: np.ndarray) -> np.ndarray:
    """Return the softness of edges (2, H, W) for steps down and up (2, 2, H, W), by the tilt of the near side."""
    return np.asarray(softness * np.exp(-TILT_POWER * edges.tilt))


def _attempts(
    edges: GridEdges, rises: ExpectedRises, mask: np.ndarray, height: np.ndarray, limits: tuple[float, int, float]
) -> Iterator[Solution]:
    """Yield the solutions of all starts, given the height of least squares and the last arguments of `robust`."""
    sharpness, max_rounds, tolerance = limits
    softness = _contour_softness(edges, rises)
    for powers in BILATERAL_STARTS:
        start, before = _bilateral(edges, mask, height, powers, sharpness, tolerance)
        solution = _graduated(rises, softness, mask, start, BILATERAL_SCALE, max_rounds, tolerance)
        yield Solution(solution.height, before + solution.rounds, solution.converged)
    evidence = curl_evidence(edges, rises, LINE_LENGTHS) + normal_evidence(edges, rises)
    softness = _softness(evidence, LINE_POWER)
    start = _weighted(rises, softness, height, REWEIGHTED_TOLERANCE)
    first = max(MISFIT_SCALE, _largest_misfit(rises, start))
    yield _graduated(rises, _step_prices(edges, softness), mask, start, first, max_rounds, tolerance)


def _weighted(rises: ExpectedRises, softness: np.ndarray, height: np.ndarray, tolerance: float) -> np.ndarray:
    """Solve for the height from a first one by least squares, weighted by precision and softness (2, H, W)."""
    weights = rises.precision * softness
    weights = np.where(rises.precision > 0.0, np.maximum(weights / (weights.max() or 1.0), MIN_EDGE_WEIGHT), 0.0)
    return solve_poisson(weights, poisson_source(weights, rises.mean), height, tolerance=tolerance)[0]


def _graduated(
    rises: ExpectedRises,
    softness: np.ndarray,
    mask: np.ndarray,
    height: np.ndarray,
    scale: float,
    max_rounds: int,
    tolerance: float,
) -> Solution:
    """Solve from a height by a redescending loss, whose scale falls from `scale`; it is less where edges are soft."""
    for completed in range(1, max_rounds + 1):
        weights = robust_weights(rises, height, softness, scale, MIN_EDGE_WEIGHT)
        previous = height
        source = poisson_source(weights, rises.mean)
        height, _, solved = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)
        if scale <= MISFIT_SCALE and _change(height, previous, mask) <= tolerance:
            return Solution(height, completed, solved)
        scale = max(scale * SHRINKING, MISFIT_SCALE)
    return Solution(height, max_rounds, False)


def _bilateral(
    edges: GridEdges,
    mask: np.ndarray,
    height: np.ndarray,
    powers: tuple[float, float],
    sharpness: float,
    tolerance: float,
) -> tuple[np.ndarray, int]:
    """Solve from a height by dividing each pixel between its sides; return the height and the rounds.

    `powers`: see BILATERAL_STARTS. The sigmoid starts as flat as the largest differences between sides require.
    """
    slope = sharpness
    for completed in range(1, BILATERAL_ROUNDS + 1):
        difference = compare_sides(edges, height, *powers)[0]
        if completed == 1:
            largest = float(np.quantile(np.abs(difference[:, mask]), LARGEST_SHARE))
            slope = min(sharpness, 1.0 / max(largest, 1e-12))
        shares = bilateral_weights(difference, slope)
        weights, source = assemble(edges, shares, WEIGHT_POWER, RISE_POWER, MIN_EDGE_WEIGHT)
        previous = height
        height = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)[0]
        if slope >= sharpness and _change(height, previous, mask) <= tolerance:
            break
        slope = min(slope * SHARPENING, sharpness)
    return height, completed


def _change(height: np.ndarray, previous: np.ndarray, mask: np.ndarray) -> float:
    return float(np.sqrt(np.mean((height - previous)[mask] ** 2)))


def _largest_misfit(rises: ExpectedRises, height: np.ndarray) -> float:
    """Return the largest misfit of a height, standard deviations of the expected rise."""
    largest = 0.0
    for axis in range(2):
        # The edges from the last row or column lead nowhere.
        mean, precision = (np.delete(values[axis], -1, axis) for values in (rises.mean, rises.precision))
        misfit = np.sqrt(precision) * np.abs(np.diff(height, axis=axis) - mean)
        largest = max(largest, float(misfit.max(initial=0.0)))
    return largest


def misfit_energy(edges: GridEdges, height: np.ndarray, sharpness: float) -> float:
    """Return the sum of the weighted squared misfits along the normals, square pixels.

    Each pixel's weight is divided between its two sides along each axis by a sigmoid, equally if `sharpness` is zero.
    """
    difference, following, preceding = compare_sides(edges, height, 0.0, 0.0)
    share = bilateral_weights(difference, sharpness)
    return float((edges.weight * (share * following + (1.0 - share) * preceding)).sum())
