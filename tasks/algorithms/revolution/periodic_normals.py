"""Normals that repeat round an axis: their means over all periods, and how well some periods predict the others.

Sums over the periods lie on a grid of circles and of places within a period, and are smoothed by a Gaussian: along the
axis when they are made, along the circle where they are read.
"""

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.vectors import unit

SIGMA_CELLS = 1.0
"""Standard deviation of the Gaussian, in cells."""
REACH = 4
"""Cells to each side at which it ends."""
GAUSSIAN = np.exp(-0.5 * (np.arange(-REACH, REACH + 1) / SIGMA_CELLS) ** 2)
GAUSSIAN /= GAUSSIAN.sum()
MIN_SUPPORT = 0.05
"""Normals per cell from which they predict others, and count as much as a surface without relief."""


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
    _add(sums, row, turns, normals, np.ones(len(row), bool))
    return sums


def sampled(sums: np.ndarray, row: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normals (N, 3) of `sums_over_periods` at places, and their support (N,) in normals per cell.

    row, turns: (N,), as there.
    """
    means = _sample(sums, row, turns)
    return np.asarray(unit(means[:, :3])), means[:, 3]


@njit(cache=True, nogil=True)
def held_out_errors(
    row: np.ndarray, turns: np.ndarray, normals: np.ndarray, rows: int, columns: int, cap: float
) -> tuple[np.ndarray, np.ndarray]:
    """Predict every other period by those between them, at the same place, and by the means of circles alone.

    Args:
        row, turns, normals, rows, columns: see `sums_over_periods`.
        cap: of an angle, degrees.

    Returns:
        Squared angles (N,) in square degrees of the two predictions, NaN where too few normals of others are near.
    """
    by_place, by_circle = np.full(len(row), np.nan), np.full(len(row), np.nan)
    is_odd = np.floor(turns) % 2.0 == 1.0
    for parity in range(2):
        is_predicted = is_odd == (parity == 1)
        sums = np.zeros((rows, columns, 4))
        _add(sums, row, turns, normals, ~is_predicted)
        circles = sums.sum(axis=1)
        for point in np.flatnonzero(is_predicted):
            mean = _mean(sums, row[point], turns[point])
            if mean[3] > MIN_SUPPORT:
                by_place[point] = _squared_angle(mean, normals[point], cap)
                by_circle[point] = _squared_angle(circles[row[point]], normals[point], cap)
    return by_place, by_circle


@njit(cache=True, nogil=True)
def _add(sums: np.ndarray, row: np.ndarray, turns: np.ndarray, normals: np.ndarray, used: np.ndarray) -> None:
    """Add the used (N,) bool of the normals to sums."""
    rows, columns, _ = sums.shape
    for point in np.flatnonzero(used):
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


@njit(cache=True, nogil=True)
def _squared_angle(mean: np.ndarray, normal: np.ndarray, cap: float) -> float:
    """Return the squared angle in square degrees, capped, of a normal (3,) from the direction of a mean (4,)."""
    length = np.sqrt(mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2)
    if not length > 0.0:
        return float(cap**2)
    chord = 0.0
    for part in range(3):
        chord += (mean[part] / length - normal[part]) ** 2
    angle = np.degrees(2.0 * np.arcsin(min(0.5 * np.sqrt(chord), 1.0)))
    return float(min(angle, cap) ** 2)
