"""Heights of a region's edges by least squares and by iteratively reweighted least squares, and the choice among them.

Weighted by the precision of the expected rises alone, least squares is right where the surface is continuous; if no
misfit exceeds the noise there is nothing else to do. Otherwise some edges are steps, and which ones is no convex
problem. Three attempts start differently: two where the two sides of each pixel are compared (bilateral), which sees
occluding contours; one from evidence in the normals, which sees steps that fade out of a slope. Each ends in the same
problem, a redescending loss of the misfits (`graduation`). All prefer steps whose near side tilts towards the far one,
and the attempt whose steps are shortest, weighted by that, wins. Where the depth of a body is known, a fourth one
starts from it, and is preferred.
"""

from collections.abc import Iterator
from dataclasses import replace

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
    largest_misfit,
    normal_evidence,
)
from glint.tasks.algorithms.integration.graduation import (
    LEAST_SQUARES_TOLERANCE,
    MIN_EDGE_WEIGHT,
    MISFIT_SCALE,
    REWEIGHTED_TOLERANCE,
    Solution,
    change,
    graduated,
    least_squares,
    normalized,
    weighted,
)
from glint.tasks.algorithms.integration.known_body import KnownBody, agrees, attached_height, beside_body
from glint.tasks.algorithms.integration.multigrid import solve_poisson
from glint.tasks.algorithms.integration.search_limits import SearchLimits

BILATERAL_STARTS = (0.5, 0.0), (1.0, 1.5)
"""Share of the squared rise in the comparison of a pixel's sides, and power of the tilt, per bilateral start; the rest
of the share is the squared misfit. With 0.5 limbs before a body come free; with 1 faces with edges stay together, whose
creases are no steps."""
TILT_POWER = 0.8
"""A step costs its length in pixels over exp(this x tilt of the near side towards the far one): steps that something
hides behind are cheap, and those to which the near side turns its back are costly."""
SHARPENING = 2.0
"""Factor of the sigmoid's slope from round to round."""
BILATERAL_ROUNDS = 20
"""Limit of the rounds of a bilateral start: it need not converge."""
LARGEST_SHARE = 0.999
"""Quantile of the differences between sides at which the first bilateral round has the inverse of its slope."""
NOISE_SCALE = 4.0
"""Largest misfit, in standard deviations of the rise, up to which a continuous surface explains the normals."""
BILATERAL_SCALE = 10.0
"""First scale after a bilateral start: its own steps have no weight, and what it got wrong may still be corrected."""
BODY_SCALE = 30.0
"""First scale of the attempt that starts from a known body, whose depth is less precise than the normals."""
BODY_PRICE_RATIO = 2.0
"""Ratio of the price of its steps to the lowest other up to which that attempt is preferred."""
EVIDENCE_SCALE = 3.0
"""Significance of a step's evidence at which its scale falls, or its weight, to half."""
CONTOUR_LENGTHS, LINE_LENGTHS = (2,), (2, 4, 8, 16)
"""Squares on both sides of an edge over which curl is summed: after a bilateral start short lines, which follow
contours; else long ones too, which see straight steps through noise, and changes of the normal."""
CONTOUR_POWER, LINE_POWER = 1.0, 2.0
"""Powers of the fall of the weight with that evidence."""
WEIGHT_POWER, RISE_POWER = 2.0, 1.0
"""Powers of the normal share with which a pixel weighs an edge in a bilateral start, and with which the rises of
the two ends are averaged: at 1 the average is the rise by the mean of the two normals, exact on circular arcs."""


def robust(edges: GridEdges, mask: np.ndarray, limits: SearchLimits, body: KnownBody | None) -> Solution:
    """Solve for the height (H, W) with steps where the normals require them; `rounds` are those of all attempts.

    A known body decides between them, unless the height contradicts it or its steps cost much more.
    """
    rises, plain = expected_rises(edges), least_squares(edges)
    continuous = _continuous(rises, plain.height, mask, limits)
    if continuous is not None:
        return continuous
    best, lowest, rounds = plain, _price(edges, plain), 0
    for attempt in _attempts(edges, rises, mask, plain.height, limits):
        price = _price(edges, attempt)
        rounds += attempt.rounds
        if price < lowest:
            best, lowest = attempt, price
    if body is not None:
        attempt = _from_body(edges, mask, body, None, limits)
        rounds += attempt.rounds
        if agrees(body, attempt.height) and _price(edges, attempt) < BODY_PRICE_RATIO * lowest:
            best = attempt
    return replace(best, rounds=rounds)


def refined(
    edges: GridEdges,
    mask: np.ndarray,
    height: np.ndarray,
    limits: SearchLimits,
    body: KnownBody | None,
) -> Solution:
    """Solve for the height as `robust`, but from one start.

    mask: (H, W) bool; height: (H, W), of a coarser grid, whose steps are kept; body: the known body that it follows, if
    it does.
    """
    if body is not None:
        return _from_body(edges, mask, body, height, limits)
    rises, plain = expected_rises(edges), least_squares(edges)
    continuous = _continuous(rises, plain.height, mask, limits)
    if continuous is not None:
        return continuous
    softness = _contour_softness(edges, rises)
    solution = graduated(rises, softness, mask, height, BILATERAL_SCALE, limits)
    return min(plain, solution, key=lambda choice: _price(edges, choice))


def _continuous(rises: ExpectedRises, height: np.ndarray, mask: np.ndarray, limits: SearchLimits) -> Solution | None:
    """Solve for the height of a continuous surface; None if it contradicts the normals by more than their noise.

    height: (H, W), of plain least squares.
    """
    even = np.ones((2, *rises.mean.shape))
    start = weighted(rises, even[0], height, LEAST_SQUARES_TOLERANCE)
    if largest_misfit(rises, start) > NOISE_SCALE:
        return None
    return graduated(rises, even, mask, start, MISFIT_SCALE, limits)


def _price(edges: GridEdges, solution: Solution) -> float:
    return step_price(edges, solution.height, TILT_POWER)


def _from_body(
    edges: GridEdges, mask: np.ndarray, body: KnownBody, height: np.ndarray | None, limits: SearchLimits
) -> Solution:
    """Solve from a known body, or from a height (H, W) that follows it."""
    edges = beside_body(edges, body)
    rises = expected_rises(edges)
    softness = _contour_softness(edges, rises)
    if height is None:
        height = attached_height(rises, normalized(rises.precision), body)
    solution = graduated(rises, softness, mask, height, BODY_SCALE, limits, body)
    return replace(solution, follows_body=True)


def _contour_softness(edges: GridEdges, rises: ExpectedRises) -> np.ndarray:
    return _step_prices(edges, _softness(curl_evidence(edges, rises, CONTOUR_LENGTHS), CONTOUR_POWER))


def _softness(evidence: np.ndarray, power: float) -> np.ndarray:
    return np.asarray((1.0 + evidence / EVIDENCE_SCALE**2) ** -power)


def _step_prices(edges: GridEdges, softness: np.ndarray) -> np.ndarray:
    """Return the softness of edges (2, H, W) for steps down and up (2, 2, H, W), by the tilt of the near side."""
    return np.asarray(softness * np.exp(-TILT_POWER * edges.tilt))


def _attempts(
    edges: GridEdges, rises: ExpectedRises, mask: np.ndarray, height: np.ndarray, limits: SearchLimits
) -> Iterator[Solution]:
    """Yield the solutions of all starts, given the height (H, W) of least squares."""
    softness = _contour_softness(edges, rises)
    for powers in BILATERAL_STARTS:
        start, before = _bilateral(edges, mask, height, powers, limits)
        solution = graduated(rises, softness, mask, start, BILATERAL_SCALE, limits)
        yield Solution(solution.height, before + solution.rounds, solution.converged)
    evidence = curl_evidence(edges, rises, LINE_LENGTHS) + normal_evidence(edges, rises)
    softness = _softness(evidence, LINE_POWER)
    start = weighted(rises, softness, height, REWEIGHTED_TOLERANCE)
    first = max(MISFIT_SCALE, largest_misfit(rises, start))
    yield graduated(rises, _step_prices(edges, softness), mask, start, first, limits)


def _bilateral(
    edges: GridEdges,
    mask: np.ndarray,
    height: np.ndarray,
    powers: tuple[float, float],
    limits: SearchLimits,
) -> tuple[np.ndarray, int]:
    """Solve from a height by dividing each pixel between its sides; return the height and the rounds.

    `powers`: see BILATERAL_STARTS. The sigmoid starts as flat as the largest differences between sides require.
    """
    sharpness = slope = limits.sharpness
    for completed in range(1, BILATERAL_ROUNDS + 1):
        difference = compare_sides(edges, height, *powers)[0]
        if completed == 1:
            largest = float(np.quantile(np.abs(difference[:, mask]), LARGEST_SHARE))
            slope = min(sharpness, 1.0 / max(largest, 1e-12))
        shares = bilateral_weights(difference, slope)
        weights, source = assemble(edges, shares, WEIGHT_POWER, RISE_POWER, MIN_EDGE_WEIGHT)
        previous = height
        height = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)[0]
        if slope >= sharpness and change(height, previous, mask) <= limits.tolerance:
            break
        slope = min(slope * SHARPENING, sharpness)
    return height, completed


def misfit_energy(edges: GridEdges, height: np.ndarray, sharpness: float) -> float:
    """Return the sum of the weighted squared misfits along the normals, square pixels.

    Each pixel's weight is divided between its two sides along each axis by a sigmoid, equally if `sharpness` is zero.
    height: (H, W), pixels.
    """
    difference, following, preceding = compare_sides(edges, height, 0.0, 0.0)
    share = bilateral_weights(difference, sharpness)
    return float((edges.weight * (share * following + (1.0 - share) * preceding)).sum())
