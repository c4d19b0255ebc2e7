"""The rises of height that normals let expect along a region's edges, how precisely, and where they contradict.

A surface that is continuous between two pixels rises by the mean of what the normals at both ends predict. That is off
by the noise of the normals, which grows with the slope, and by where between the pixels the slope changes. Around a
square of four pixels the rises of a continuous surface sum to zero; what is left is the curl. Beside a step it stays
where the height of the step changes, so that lines of curl are steps, and noise is not aligned.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.integration.edges import GridEdges

LEAST_NOISE = 0.01
"""Least noise of normals in radians, so that quantisation, sampling and smoothing are not taken for steps."""
CREASE_VARIANCE = 1.0 / 12.0
"""Variance of the rise where the slope changes, as a share of the squared difference of the two predictions: the place
between the two pixels at which it does is uniformly distributed."""
NORMAL_CHANGE_RATIO = 1.5
"""Ratio to the edges before and behind from which two predictions differ by more than curvature lets expect."""


class ExpectedRises(NamedTuple):
    """Rises that a continuous surface would have; compiled functions take it whole.

    mean: (2, H, W) float64, expected rise in pixels from the pixel to its next one along the axis.
    precision: (2, H, W) float64, the inverse of its variance times the less certain end's weight, 0 outside the mask.
    noise: of the normals, radians, standard deviation per axis.
    """

    mean: np.ndarray
    precision: np.ndarray
    noise: float


def expected_rises(edges: GridEdges) -> ExpectedRises:
    """Compute the expected rises of a region; the noise of the normals follows from the median of the curl."""
    mean = (edges.forward_rise + edges.backward_rise) / 2
    # A normal that is off by an angle changes the slope by that angle over the squared cosine, at worst.
    spread = edges.normal_share**-4.0
    curl = loop_curl(edges, mean)
    known = np.isfinite(curl)
    noise = LEAST_NOISE
    if known.any():
        weight = _loop_mean(edges.weight)
        certain = known & (weight >= np.median(weight[known]))
        relative = curl[certain] / np.sqrt(2 * _loop_mean(spread)[certain])
        noise = max(noise, robust_deviation(relative))
    return ExpectedRises(mean, _precision(edges, spread, noise), noise)


@njit(cache=True, nogil=True)
def _precision(edges: GridEdges, spread: np.ndarray, noise: float) -> np.ndarray:
    inside, forward_rise, backward_rise, _, weight, _ = edges
    variance, precision = np.zeros(forward_rise.shape), np.zeros(forward_rise.shape)
    rows, columns = spread.shape
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows - di):
            for j in range(columns - dj):
                change = forward_rise[axis, i, j] - backward_rise[axis, i, j]
                sampled = noise * noise * (spread[i, j] + spread[i + di, j + dj]) / 4
                variance[axis, i, j] = sampled + CREASE_VARIANCE * change * change
        for i in range(rows):
            for j in range(columns):
                if not inside[axis, i, j]:
                    continue
                # The mean with the two parallel edges: by itself, the variance would follow the noise of the slope and
                # prefer slopes that are too gentle.
                total, count = variance[axis, i, j], 1
                if i >= dj and j >= di and inside[axis, i - dj, j - di]:
                    total += variance[axis, i - dj, j - di]
                    count += 1
                if i + dj < rows and j + di < columns and inside[axis, i + dj, j + di]:
                    total += variance[axis, i + dj, j + di]
                    count += 1
                precision[axis, i, j] = min(weight[i, j], weight[i + di, j + dj]) * count / total
    return precision


@njit(cache=True, nogil=True)
def robust_weights(rises: ExpectedRises, height: np.ndarray, softness: np.ndarray, scale: float) -> np.ndarray:
    """Return the weights (2, H, W) of the edges for a height (H, W) by a redescending loss.

    It is Barron's (A General and Adaptive Robust Loss Function, CVPR 2019) with the shape -4, whose weight falls with
    the sixth power of a large misfit. `scale` is in standard deviations of the expected rise, and its square is
    multiplied by an edge's `softness` (2, 2, H, W) > 0, for steps down and for steps up to the next pixel: the price of
    a step is proportional to it. The weight of an edge without misfit is its precision.
    """
    mean, precision, _ = rises
    weights = np.zeros(mean.shape)
    rows, columns = height.shape
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                if precision[axis, i, j] > 0.0:
                    misfit = height[i + di, j + dj] - height[i, j] - mean[axis, i, j]
                    side = 0 if misfit < 0.0 else 1
                    square = misfit * misfit * precision[axis, i, j] / (scale * scale * softness[side, axis, i, j])
                    weights[axis, i, j] = precision[axis, i, j] / (1.0 + square) ** 3
    return weights


def largest_misfit(rises: ExpectedRises, height: np.ndarray) -> float:
    """Return the largest misfit of a height (H, W), standard deviations of the expected rise."""
    largest = 0.0
    for axis in range(2):
        # The edges from the last row or column lead nowhere.
        mean, precision = (np.delete(values[axis], -1, axis) for values in (rises.mean, rises.precision))
        misfit = np.sqrt(precision) * np.abs(np.diff(height, axis=axis) - mean)
        largest = max(largest, float(misfit.max(initial=0.0)))
    return largest


def poisson_source(weights: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return the right-hand side (H, W) of the Poisson equations of edges with weights and rises (2, H, W)."""
    down, across = weights * rise
    source = -down
    source[1:] += down[:-1]
    source -= across
    source[:, 1:] += across[:, :-1]
    return np.asarray(source)


def loop_curl(edges: GridEdges, rise: np.ndarray) -> np.ndarray:
    """Return the sum of rises (2, H, W) around each square of a pixel and its next ones (H, W), NaN outside."""
    down, across = edges.inside
    whole = down & across & np.roll(down, -1, 1) & np.roll(across, -1, 0)
    whole[-1], whole[:, -1] = False, False
    curl = rise[0] + np.roll(rise[1], -1, 0) - np.roll(rise[0], -1, 1) - rise[1]
    return np.where(whole, curl, np.nan)


def curl_evidence(edges: GridEdges, rises: ExpectedRises, lengths: tuple[int, ...]) -> np.ndarray:
    """Return the squared significance of the curl along each edge (2, H, W) float64, if it were a step.

    A step across an edge continues through the squares on both of its sides. The curl is summed over the `lengths` next
    squares on each, straight on, and divided by what noise gives; the largest counts. At least the lesser of
    the two adjacent squares' own counts.
    """
    deviation = rises.noise * np.sqrt(2 * _loop_mean(edges.normal_share**-4.0))
    relative = np.nan_to_num(loop_curl(edges, rises.mean) / deviation * _loop_mean(edges.weight))
    return _line_sums(edges.inside, relative, np.array(lengths))


@njit(cache=True, nogil=True)
def _line_sums(inside: np.ndarray, relative: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    evidence = np.zeros(inside.shape)
    rows, columns = relative.shape
    for axis in range(2):
        # Squares along the step: those of an edge down lie side by side, those of an edge across above each other.
        di, dj = axis, 1 - axis
        for i in range(rows):
            for j in range(columns):
                if not inside[axis, i, j]:
                    continue
                before = relative[i - di, j - dj] if i >= di and j >= dj else 0.0
                best = min(relative[i, j] ** 2, before**2)
                for length in lengths:
                    total = 0.0
                    for k in range(-length, length):
                        m, n = i + k * di, j + k * dj
                        if 0 <= m < rows and 0 <= n < columns:
                            total += relative[m, n]
                    best = max(best, total * total / (2 * length))
                evidence[axis, i, j] = best
    return evidence


def normal_evidence(edges: GridEdges, rises: ExpectedRises) -> np.ndarray:
    """Return the squared significance of changes of the normal along each edge (2, H, W) float64.

    Counted is by how much more the two predictions differ than those before and behind, which curvature explains.
    """
    change = np.zeros(edges.forward_rise.shape)
    for axis in range(2):
        share = np.minimum(edges.normal_share, np.roll(edges.normal_share, -1, axis))
        weight = np.minimum(edges.weight, np.roll(edges.weight, -1, axis))
        difference = np.abs(edges.forward_rise[axis] - edges.backward_rise[axis]) * share * weight
        difference[~edges.inside[axis]] = 0.0
        beside = np.maximum(np.roll(difference, 1, axis), np.roll(difference, -1, axis))
        change[axis] = np.maximum(difference - NORMAL_CHANGE_RATIO * beside, 0.0)
    return np.asarray((change / rises.noise) ** 2)


def _loop_mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of values (H, W) over each square of a pixel and its next ones; the last row and column wrap."""
    pairs = values + np.roll(values, -1, 1)
    return np.asarray((pairs + np.roll(pairs, -1, 0)) / 4)
