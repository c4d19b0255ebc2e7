"""Evidence for the rim of a foot along an ellipse: flashes on its near half, edges on its far one, table outside.

Evidence is the slope across the rim, per pixel: of lines in edges of the table, of flashes in their log ratio to the
table's. It is bounded.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

NEAR_EDGE_WEIGHT = 0.4
"""Weight of edges of the near rim: without flashes it may be that of a matte coaster."""
BEYOND_WEIGHT, BEYOND_DISTANCE_PX = 0.5, 3.0
"""Weight of what speaks against a place: edges and flashes so far outside it, where the table should be."""
NEUTRAL_EVIDENCE = 0.4
"""Evidence that counts neither for nor against an ellipse."""


class Ellipse(NamedTuple):
    """An ellipse: its centre (x, y), half its width and half its height in pixels, and its tilt in radians.

    tilt: of its width, from the columns to the rows.
    """

    x: float
    y: float
    half_width: float
    half_height: float
    tilt: float

    @property
    def lowest(self) -> tuple[float, float]:
        """Column and row of the end of its height."""
        return self.x - self.half_height * np.sin(self.tilt), self.y + self.half_height * np.cos(self.tilt)

    def scaled(self, factor: float) -> "Ellipse":
        """Return it on a grid `factor` times as fine, (0, 0) being the centre of the top-left pixel."""
        x, y = ((place + 0.5) * factor - 0.5 for place in (self.x, self.y))
        return Ellipse(x, y, self.half_width * factor, self.half_height * factor, self.tilt)


class Evidence(NamedTuple):
    """Where a rim may be.

    lines, flashes: (2, H, W), their slopes down and right. amount: (H, W), the larger of their magnitudes.
    """

    lines: np.ndarray
    flashes: np.ndarray
    amount: np.ndarray


class EllipseGrid(NamedTuple):
    """Ellipses that are tried: all combinations of these.

    lowest: column and row of the end of the height. across, down: (N,) offsets of that end, pixels. half_widths: (N,),
    pixels. aspects: (N,), heights relative to widths. tilts: (N,), radians.
    """

    lowest: tuple[float, float]
    across: np.ndarray
    down: np.ndarray
    half_widths: np.ndarray
    aspects: np.ndarray
    tilts: np.ndarray


@njit(cache=True, nogil=True)
def best_ellipse(
    evidence: Evidence, grid: EllipseGrid, samples: int, bound: float
) -> tuple[float, tuple[float, float, float, float, float]]:
    """Return the largest sum of evidence along a rim in excess of the neutral level, and the ellipse, as in `Ellipse`.

    samples: places along the rim. bound: of the evidence of a place. The sum is -inf if all rims leave the image.
    """
    most, best, lowest = -np.inf, (0.0, 0.0, 1.0, 1.0, 0.0), grid.lowest
    for tilt in grid.tilts:
        cosine, sine = np.cos(tilt), np.sin(tilt)
        for half_width in grid.half_widths:
            for aspect in grid.aspects:
                half_height = aspect * half_width
                for below in grid.down:
                    for beside in grid.across:
                        x = lowest[0] + beside * cosine - (below - half_height) * sine
                        y = lowest[1] + beside * sine + (below - half_height) * cosine
                        ellipse = (x, y, half_width, half_height, tilt)
                        near, far, length = mean_evidence(evidence, ellipse, samples, bound)
                        excess = (0.5 * (near + far) - NEUTRAL_EVIDENCE) * length
                        if length > 0.0 and excess > most:
                            most, best = excess, ellipse
    return most, best


@njit(cache=True, nogil=True)
def mean_evidence(
    evidence: Evidence, ellipse: tuple[float, float, float, float, float], samples: int, bound: float
) -> tuple[float, float, float]:
    """Return the mean evidence of a rim's near and far halves, and its length in pixels, 0 if it leaves the image."""
    x, y, half_width, half_height, tilt = ellipse
    cosine, sine = np.cos(tilt), np.sin(tilt)
    sums, lengths = np.zeros(2), np.zeros(2)
    for number in range(samples):
        angle = 2.0 * np.pi * (number + 0.5) / samples
        u, v = half_width * np.cos(angle), half_height * np.sin(angle)
        normal_u, normal_v = half_height * np.cos(angle), half_width * np.sin(angle)
        size = np.hypot(normal_u, normal_v)
        column, row = x + u * cosine - v * sine, y + u * sine + v * cosine
        right, below = (normal_u * cosine - normal_v * sine) / size, (normal_u * sine + normal_v * cosine) / size
        is_near, most = v > 0.0, 0.0
        # A rim of less than a pixel lies anywhere between two samples across it.
        for offset in (-0.7, 0.0, 0.7):
            i, j = row + offset * below, column + offset * right
            if not _is_inside(evidence.amount, i, j):
                return 0.0, 0.0, 0.0
            edge = abs(_slope(evidence.lines, i, j, below, right))
            edge = NEAR_EDGE_WEIGHT * min(edge, bound) if is_near else edge
            # Flashes lie on the rim, not outside it.
            most = max(most, edge, -_slope(evidence.flashes, i, j, below, right))
        i, j = row + BEYOND_DISTANCE_PX * below, column + BEYOND_DISTANCE_PX * right
        outer = _sample(evidence.amount, i, j) if _is_inside(evidence.amount, i, j) else 0.0
        half, part = 0 if is_near else 1, 2.0 * np.pi / samples * size
        sums[half] += part * (min(most, bound) - BEYOND_WEIGHT * min(outer, bound))
        lengths[half] += part
    return sums[0] / lengths[0], sums[1] / lengths[1], lengths.sum()


@njit(cache=True, nogil=True)
def _slope(slopes: np.ndarray, row: float, column: float, below: float, right: float) -> float:
    return _sample(slopes[0], row, column) * below + _sample(slopes[1], row, column) * right


@njit(cache=True, nogil=True)
def _is_inside(image: np.ndarray, row: float, column: float) -> bool:
    return 0.0 <= row < image.shape[0] - 1 and 0.0 <= column < image.shape[1] - 1


@njit(cache=True, nogil=True)
def _sample(image: np.ndarray, row: float, column: float) -> float:
    """Return an image (H, W) at a place inside it, interpolated."""
    i, j = int(row), int(column)
    down, right = row - i, column - j
    upper = image[i, j] * (1.0 - right) + image[i, j + 1] * right
    lower = image[i + 1, j] * (1.0 - right) + image[i + 1, j + 1] * right
    return upper * (1.0 - down) + lower * down
