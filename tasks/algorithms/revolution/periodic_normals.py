"""Normals that repeat round an axis: which candidates other periods show at the same place, and the means of these.

Places lie on a grid of circles and of columns within a period. Means are smoothed by a Gaussian: along the axis when
sums are made, along the circle where they are read.
"""

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.vectors import unit

COS_SAME = np.cos(np.radians(6.0))
"""Cosine of the angle up to which candidates of two periods are the same normal."""
MIN_PIXELS = 2
"""Pixels of other periods that show a candidate that repeats."""
SIGMA_CELLS = 1.0
"""Standard deviation of the Gaussian, in cells."""
REACH = 4
"""Cells to each side at which it ends."""
GAUSSIAN = np.exp(-0.5 * (np.arange(-REACH, REACH + 1) / SIGMA_CELLS) ** 2)
GAUSSIAN /= GAUSSIAN.sum()
"""Its weights (2 REACH + 1,), which sum to 1."""


@njit(cache=True, nogil=True)
def repeated_candidates(
    row: np.ndarray,
    turns: np.ndarray,
    candidates: np.ndarray,
    rows: int,
    columns: int,
    shift: int,
    least_share: float,
    asked: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return which candidate of each asked pixel most other periods show, and how well it agrees with them.

    Pixels of other periods count that are at most one cell from the same place.

    Args:
        row: (N,) int, of each pixel's circle.
        turns: (N,), periods from the azimuth 0; the fraction is the place within a period.
        candidates: (K, N, 3), unit, in the frames of axis, radius and circle, NaN where there is none.
        rows: number of circles.
        columns: number of places within a period.
        shift: columns by which other periods are moved: what repeats after a part of a period does so by chance.
        least_share: of the pixels that count, which must show a candidate.
        asked: (M,) int, pixels.

    Returns:
        Numbers (M,) int of candidates, -1 where too few pixels show one, and their agreement (M,): 1 if all show the
        same normal, 0 without such a candidate.
    """
    period, cell = np.empty(len(row), np.int64), np.empty(len(row), np.int64)
    first = np.zeros(rows * columns + 1, np.int64)
    for pixel in range(len(row)):
        period[pixel] = int(np.floor(turns[pixel]))
        column = min(int((turns[pixel] - period[pixel]) * columns), columns - 1)
        cell[pixel] = row[pixel] * columns + column
        first[cell[pixel] + 1] += 1
    first = np.cumsum(first)
    by_cell, end = np.empty(len(row), np.int64), first[:-1].copy()
    for pixel in range(len(row)):
        by_cell[end[cell[pixel]]] = pixel
        end[cell[pixel]] += 1

    repeated, agreement = np.full(len(asked), -1), np.zeros(len(asked))
    shown, closeness = np.empty(len(candidates)), np.empty(len(candidates))
    for number, pixel in enumerate(asked):
        shown[:], closeness[:] = 0.0, 0.0
        compared = 0
        column = cell[pixel] % columns + shift
        for beside in range(max(row[pixel] - 1, 0), min(row[pixel] + 2, rows)):
            for step in range(-1, 2):
                place = beside * columns + (column + step) % columns
                for other in by_cell[first[place] : first[place + 1]]:
                    if period[other] != period[pixel]:
                        compared += 1
                        _add_shown(shown, closeness, candidates[:, pixel], candidates[:, other])
        best = np.argmax(shown)
        if shown[best] >= max(MIN_PIXELS, least_share * compared):
            repeated[number], agreement[number] = best, closeness[best] / compared
    return repeated, agreement


def sums_over_periods(row: np.ndarray, turns: np.ndarray, normals: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Return the sums (rows, columns, 4) of normals over all periods, and how many they are, smoothed along the axis.

    Args:
        row: (N,) int, of each normal's circle.
        turns: (N,), periods from the azimuth 0; the fraction is the place within a period.
        normals: (N, 3), in the frames of axis, radius and circle.
        rows: number of circles.
        columns: number of places within a period.
    """
    sums = np.zeros((rows, columns, 4))
    _add(sums, row, turns, normals)
    return sums


def sampled(sums: np.ndarray, row: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (N, 3) of `sums_over_periods` at places, and their support (N,) in normals per cell.

    row, turns: (N,), as there.
    """
    means = _sample(sums, row, turns)
    return np.asarray(unit(means[:, :3])), means[:, 3]


@njit(cache=True, nogil=True)
def _add_shown(shown: np.ndarray, closeness: np.ndarray, candidates: np.ndarray, neighbours: np.ndarray) -> None:
    """Add 1 to shown (K,) for each of a pixel's candidates (K, 3) that is one of another pixel's (K, 3).

    closeness: (K,), to which 1 is added for equal normals, and less with the square of their angle.
    """
    for number in range(len(candidates)):
        x, y, z = candidates[number]
        if np.isnan(x):
            continue
        closest = COS_SAME
        for other in neighbours:
            cosine = x * other[0] + y * other[1] + z * other[2]
            if cosine > closest:
                closest = cosine
        if closest > COS_SAME:
            shown[number] += 1.0
            closeness[number] += (closest - COS_SAME) / (1.0 - COS_SAME)


@njit(cache=True, nogil=True)
def _add(sums: np.ndarray, row: np.ndarray, turns: np.ndarray, normals: np.ndarray) -> None:
    rows, columns, _ = sums.shape
    for point in range(len(row)):
        column = min(int(turns[point] % 1.0 * columns), columns - 1)
        for shift in range(-REACH, REACH + 1):
            if 0 <= row[point] + shift < rows:
                cell, share = sums[row[point] + shift, column], GAUSSIAN[shift + REACH]
                for part in range(3):
                    cell[part] += share * normals[point, part]
                cell[3] += share


@njit(cache=True, nogil=True)
def _sample(sums: np.ndarray, row: np.ndarray, turns: np.ndarray) -> np.ndarray:
    means = np.empty((len(row), 4))
    for point in range(len(row)):
        means[point] = _mean(sums, row[point], turns[point])
    return means


@njit(cache=True, nogil=True)
def _mean(sums: np.ndarray, row: int, turns: float) -> np.ndarray:
    """Return sums (4,) at a place between two columns, smoothed along the circle."""
    columns = sums.shape[1]
    place = turns % 1.0 * columns - 0.5
    first = int(np.floor(place))
    share = place - first
    mean = np.zeros(4)
    for shift in range(-REACH, REACH + 2):
        weight = 0.0
        if shift <= REACH:
            weight += (1.0 - share) * GAUSSIAN[shift + REACH]
        if shift > -REACH:
            weight += share * GAUSSIAN[shift + REACH - 1]
        cell = sums[row, (first + shift) % columns]
        for part in range(4):
            mean[part] += weight * cell[part]
    return mean
