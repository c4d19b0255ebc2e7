"""Densest discs of each pixel's highlights on the hemisphere of half vectors, one after the other.

Densities are counted in the cells of an equal-area map. The disc around the densest cell is centred by mean shift
(Cheng 1995), and its highlights are withdrawn before the next one is looked for.
"""

import numpy as np
from numba import njit

from glint.tasks.algorithms.candidates.lit_frames import LitFrames
from glint.tasks.algorithms.geometry.vectors import equal_area

CELL_DEG = 1.1
"""Edge in degrees of the cells in which densities are counted: half the disc of a usual light."""
MEAN_SHIFT_STEPS, POWER_ITERATIONS = 6, 30
"""Steps of the mean shift, and limit of the power iteration, which ends where the eigenvector stands still."""
FASTMATH = {"nsz", "arcp", "contract", "reassoc"}
"""Rules of arithmetic that the compiler may relax; NaN and infinity keep their meaning."""

Discs = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Normals (K, N, 3), weight, spread, count (K, N) and winner (N, 3) of N pixels, as in `Clusters`."""


def densest_discs(
    lit: LitFrames, half_vectors: np.ndarray, weights: np.ndarray, discs: int, radius: float, separation: float
) -> Discs:
    """Find up to `discs` discs of highlights of each pixel.

    Args:
        lit: lit frames of the pixels.
        half_vectors: (T, 3) float32, NaN where the frame was rejected.
        weights: (T,) float32, of the frames.
        discs: largest number per pixel, K.
        radius: of a disc, radians.
        separation: least distance, in radii, of another disc's highlights.
    """
    return _densest_discs(lit, half_vectors, weights, *_cells(half_vectors), discs, radius, separation)


def _cells(half_vectors: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the cell (T,) int32 of each half vector in an equal-area map of the hemisphere, and its edge in cells.

    A margin of two cells lets `_densest` read neighbours without tests.
    """
    cell = np.radians(CELL_DEG)
    size = int(np.ceil(2.0 * np.sqrt(2.0) / cell)) + 5
    known = np.where(np.isfinite(half_vectors), half_vectors, (0.0, 0.0, 1.0))
    plane = equal_area(known)
    column, row = np.floor(plane / cell + size / 2).astype(np.int32).clip(2, size - 3).T
    return row * size + column, size


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _densest_discs(
    lit: LitFrames,
    half_vectors: np.ndarray,
    weights: np.ndarray,
    cells: np.ndarray,
    size: int,
    discs: int,
    radius: float,
    separation: float,
) -> Discs:
    """Find the discs as `densest_discs`, given the cell (T,) of each half vector and the map's edge in cells."""
    pixels = len(lit.starts) - 1
    normals = np.full((discs, pixels, 3), np.nan, np.float32)
    weight = np.zeros((discs, pixels), np.float32)
    spread = np.full((discs, pixels), np.nan, np.float32)
    count = np.zeros((discs, pixels), np.int32)
    winner = np.full((pixels, 3), np.nan, np.float32)
    # Weight per cell of the present pixel's highlights; all zero between pixels.
    density = np.zeros(size * size, np.float32)
    cos_radius, cos_separation = np.cos(radius), np.cos(separation * radius)
    for pixel in range(pixels):
        own = slice(lit.starts[pixel], lit.starts[pixel + 1])
        frames = lit.frames[own]
        if len(frames) == 0:
            continue
        # A dim frame shows the edge of a highlight.
        h, w, own_cells = half_vectors[frames], weights[frames] * lit.brightness[own], cells[frames]
        _top_eigenvector(h, winner[pixel])
        for i in range(len(w)):
            density[own_cells[i]] += w[i]
        for k in range(discs):
            first, last = _densest(own_cells, w, density, size)
            if first < 0:
                break
            # Between the first and the last highlight of one disc, or at the first of two.
            centre = h[first].copy()
            if h[first, 0] * h[last, 0] + h[first, 1] * h[last, 1] + h[first, 2] * h[last, 2] > cos_radius:
                centre += h[last]
                centre /= np.sqrt((centre**2).sum())
            _shift_to_mean(centre, h, w, cos_radius)
            # Measure the disc, and withdraw all highlights within the separation: a weight of zero marks them. The
            # squared chord 2 (1 - cos) stands for the squared angle.
            total = square = np.float32(0.0)
            for i in range(len(w)):
                cosine = h[i, 0] * centre[0] + h[i, 1] * centre[1] + h[i, 2] * centre[2]
                if w[i] > 0 and cosine > cos_radius:
                    total += w[i]
                    square += w[i] * 2.0 * (1.0 - cosine)
                    count[k, pixel] += 1
                if w[i] > 0 and cosine > cos_separation:
                    density[own_cells[i]] -= w[i]
                    w[i] = 0.0
            weight[k, pixel] = total
            spread[k, pixel] = np.sqrt(square / max(total, np.float32(1e-9)))
            normals[k, pixel] = centre
        for cell in own_cells:
            density[cell] = 0.0
    return normals, weight, spread, count, winner


@njit(cache=True, nogil=True)
def _densest(cells: np.ndarray, w: np.ndarray, density: np.ndarray, size: int) -> tuple[int, int]:
    """Return the first and the last highlight around which a disc of five cells across holds the most weight.

    All highlights in one disc tie; using only the first or the last would bias the centre along the light's path. Both
    are -1 if none is left.

    cells, w: cell and weight (M,) of a pixel's highlights, a weight of 0 being withdrawn; density: weight per cell.
    """
    first, last, highest = -1, -1, np.float32(0.0)
    for i in range(len(cells)):
        if w[i] <= 0:
            continue
        cell = cells[i]
        # Consecutive frames mostly share a cell, whose sum is known already.
        if i > 0 and cells[i - 1] == cell and w[i - 1] > 0:
            if last == i - 1:
                last = i
            continue
        # Sum over a disc of cells: five by five without the corners.
        total = np.float32(0.0)
        for row in range(-2, 3):
            reach = 1 if abs(row) == 2 else 2
            for column in range(-reach, reach + 1):
                total += density[cell + row * size + column]
        # Rounding must not break a tie.
        if total > highest * np.float32(1.0001):
            first, highest = i, total
        if total >= highest * np.float32(0.9999):
            last = i
    return first, last


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _shift_to_mean(centre: np.ndarray, h: np.ndarray, w: np.ndarray, cos_radius: float) -> None:
    """Move a disc's centre (3,) to the weighted mean of the highlights inside it, again and again (mean shift).

    h (M, 3), w (M,): half vectors and weights of a pixel's highlights.
    """
    for _ in range(MEAN_SHIFT_STEPS):
        x = y = z = np.float32(0.0)
        for i in range(len(w)):
            if w[i] > 0 and h[i, 0] * centre[0] + h[i, 1] * centre[1] + h[i, 2] * centre[2] > cos_radius:
                x += w[i] * h[i, 0]
                y += w[i] * h[i, 1]
                z += w[i] * h[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0:
            break
        centre[0], centre[1], centre[2] = x / length, y / length, z / length


@njit(cache=True, nogil=True)
def _top_eigenvector(h: np.ndarray, vector: np.ndarray) -> None:
    """Write the top eigenvector of sum h h^T over rows (M, 3), with n_z > 0, to `vector` (3,), by power iteration."""
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(len(h)):
        xx += h[i, 0] * h[i, 0]
        xy += h[i, 0] * h[i, 1]
        xz += h[i, 0] * h[i, 2]
        yy += h[i, 1] * h[i, 1]
        yz += h[i, 1] * h[i, 2]
        zz += h[i, 2] * h[i, 2]
    # All half vectors have n_z > 0, so the third column is a good start with the right sign.
    x, y, z = xz, yz, zz
    for _ in range(POWER_ITERATIONS):
        u, v, w = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
        scale = 1.0 / np.sqrt(u * u + v * v + w * w)
        u, v, w = u * scale, v * scale, w * scale
        is_converged = abs(u - x) + abs(v - y) + abs(w - z) < 1e-7
        x, y, z = u, v, w
        if is_converged:
            break
    vector[0], vector[1], vector[2] = x, y, z
