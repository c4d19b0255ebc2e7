"""Clusters of candidate normals from each pixel's highlights ("normal clustering", section 4.2 of Yeung et al. 2009).

A pixel shows a highlight in those frames whose half vector is a normal of one of its light paths. The light is not a
point, so each direct path lights a small disc of half vectors; false paths light discs too, or arcs. The paper uses
k-means, with K by minimum description length. Here the size of the disc is known, and each cluster is the densest disc
of the highlights that the clusters before it left, centred by mean shift (Cheng 1995) where it is brightest: an arc
beside a disc cannot pull its centre, and a disc that only one frame shows is kept.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels, LitFrames, collect_lit_frames
from glint.tasks.algorithms.candidates.surround import Rings, find_rings, surround_response
from glint.tasks.algorithms.geometry.vectors import equal_area

CELL_DEG = 1.1
"""Edge in degrees of the cells in which densities are counted: half the disc of a usual light."""
MEAN_SHIFT_STEPS, POWER_ITERATIONS = 6, 30
"""Steps of the mean shift, and limit of the power iteration, which ends where the eigenvector stands still."""


@dataclass(frozen=True, slots=True)
class Clusters:
    """Candidate normals of each pixel in the order in which they are found: each the densest disc of what is left.

    normals: (K, H, W, 3) float32, unit, camera frame, NaN where there is no such cluster. weight: (K, H, W) float32,
    solid angle of half vectors that it covers, in units of the lights' spacing. spread: (K, H, W) float32, RMS angle in
    radians to the normal. count: (K, H, W) int32, frames. observations: (H, W) int32, the paper's M: frames in which
    the pixel is lit. winner: (H, W, 3) float32, top eigenvector of sum h h^T over all of them (Chen et al. 2006).
    shading: (K, H, W) float32, level beside the candidate's disc between dark (0) and lit (1); NaN where unknown.
    """

    normals: np.ndarray
    weight: np.ndarray
    spread: np.ndarray
    count: np.ndarray
    observations: np.ndarray
    winner: np.ndarray
    shading: np.ndarray


def inverse_density_weights(half_vectors: np.ndarray, radius_deg: float = 1.0) -> np.ndarray:
    """Return each frame's weight (T,) float32: one over the number of frames within `radius_deg`, 0 without a light.

    A hand-held light lingers; unweighted, a place where it rested would outvote the rest of the sweep.

    Args:
        half_vectors: (T, 3), NaN where the frame was rejected.
        radius_deg: angle within which lights share one vote.
    """
    weights = np.zeros(len(half_vectors), np.float32)
    known = np.isfinite(half_vectors[:, 0])
    if known.any():
        tree = cKDTree(half_vectors[known])
        chord = 2.0 * np.sin(np.radians(radius_deg) / 2.0)
        weights[known] = 1.0 / tree.query_ball_point(half_vectors[known], chord, return_length=True)
    return weights


def cluster_pixels(
    frames: np.ndarray,
    highlights: HighlightLevels,
    half_vectors: np.ndarray,
    weights: np.ndarray,
    *,
    clusters: int = 3,
    radius_deg: float = 2.2,
    separation: float = 1.6,
    rings: Rings | None = None,
) -> Clusters:
    """Cluster the highlights of a tile's pixels.

    Args:
        frames: (T, H, W) uint8 or uint16.
        highlights: their levels; thresholds (H, W).
        half_vectors: (T, 3) float32, NaN where the frame was rejected.
        weights: (T,) float32 from `inverse_density_weights`.
        clusters: largest number per pixel, K.
        radius_deg: of the light's disc of half vectors.
        separation: least distance, in radii, of another cluster's highlights.
        rings: of these half vectors and weights, where several tiles share them.
    """
    height, width = frames.shape[1:]
    usable = np.flatnonzero(np.isfinite(half_vectors[:, 0]))
    levels, radius = frames.reshape(len(frames), -1), float(np.radians(radius_deg))
    flat = highlights._replace(thresholds=highlights.thresholds.reshape(-1))
    lit = collect_lit_frames(levels, usable, flat)
    normals, weight, spread, count, winner = _cluster(
        lit, half_vectors, weights, *_cells(half_vectors), clusters, radius, separation
    )
    rings = rings or find_rings(half_vectors, weights)
    shading = surround_response(levels, lit, half_vectors, normals, float(np.cos(radius)), rings)
    shape = (clusters, height, width)
    return Clusters(
        normals.reshape(*shape, 3),
        weight.reshape(shape),
        spread.reshape(shape),
        count.reshape(shape),
        np.diff(lit.starts).astype(np.int32).reshape(height, width),
        winner.reshape(height, width, 3),
        shading.reshape(shape),
    )


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


@njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract", "reassoc"})
def _cluster(
    lit: LitFrames,
    half_vectors: np.ndarray,
    weights: np.ndarray,
    cells: np.ndarray,
    size: int,
    clusters: int,
    radius: float,
    separation: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return normals (K, N, 3), weight, spread, count (K, N) and winner (N, 3) of N pixels; radius in radians."""
    pixels = len(lit.starts) - 1
    normals = np.full((clusters, pixels, 3), np.nan, np.float32)
    weight = np.zeros((clusters, pixels), np.float32)
    spread = np.full((clusters, pixels), np.nan, np.float32)
    count = np.zeros((clusters, pixels), np.int32)
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
        h, w = half_vectors[frames], weights[frames] * lit.brightness[own]
        _top_eigenvector(h, winner[pixel])
        for k in range(clusters):
            # 1. Start at the densest place, between the first and the last highlight of one disc.
            first, last = _densest(cells[frames], w, density, size, k == 0)
            if first < 0:
                break
            centre = h[first].copy()
            if h[first, 0] * h[last, 0] + h[first, 1] * h[last, 1] + h[first, 2] * h[last, 2] > cos_radius:
                centre += h[last]
                centre /= np.sqrt((centre**2).sum())
            # 2. Mean shift: move the disc to the weighted mean of the highlights inside it.
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
            # 3. Measure the cluster inside the disc, and withdraw all highlights within the separation from the
            # clusters to come; a weight of zero marks them. The squared chord 2 (1 - cos) stands for the squared angle.
            total = square = np.float32(0.0)
            for i in range(len(w)):
                cosine = h[i, 0] * centre[0] + h[i, 1] * centre[1] + h[i, 2] * centre[2]
                if w[i] > 0 and cosine > cos_radius:
                    total += w[i]
                    square += w[i] * 2.0 * (1.0 - cosine)
                    count[k, pixel] += 1
                if w[i] > 0 and cosine > cos_separation:
                    density[cells[frames[i]]] -= w[i]
                    w[i] = 0.0
            normals[k, pixel] = centre
            weight[k, pixel] = total
            spread[k, pixel] = np.sqrt(square / max(total, np.float32(1e-9)))
        for t in frames:
            density[cells[t]] = 0.0
    return normals, weight, spread, count, winner


@njit(cache=True, nogil=True)
def _densest(cells: np.ndarray, w: np.ndarray, density: np.ndarray, size: int, fill: bool) -> tuple[int, int]:
    """Return the first and the last highlight around which a disc of five cells across holds the most weight.

    All highlights in one disc tie; using only the first or the last would bias the centre along the light's path. Both
    are -1 if none is left.

    cells, w: cell and weight (M,) of a pixel's highlights, a weight of 0 being withdrawn; density: weight per cell,
    which `fill` computes first.
    """
    if fill:
        for i in range(len(cells)):
            density[cells[i]] += w[i]
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
