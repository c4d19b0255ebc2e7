"""From a pixel's highlights to clusters of candidate normals (paper 4.1, METHOD 3).

A pixel glints in those frames whose half vector is a normal of one of its light paths. The lamp is no point, so each
direct path lights a small disc of half vectors; false ones light discs too, or arcs. The paper finds them by k-means
with K by minimum description length. Knowing the disc's size is worth more: here each cluster is the densest disc of
what the heavier ones left: an arc beside a disc cannot pull its centre away, and a disc seen in one frame stays.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from glint.tasks.algorithms.errors import UnusableCapture

CELL = 1.1
"""Edge in degrees of the cells that are searched for dense places: half a usual lamp's disc."""


@dataclass(frozen=True, slots=True)
class Clusters:
    """Candidate normals of each pixel, heaviest first.

    normals (K, H, W, 3) float32, unit, NaN where there is no such cluster; weight (K, H, W) float32, the solid angle
    of half vectors that it covers in units of the lights' spacing; spread (K, H, W) float32, RMS angle in radians to
    the normal; count (K, H, W) int32 frames; observations (H, W) int32 = M, bright frames; winner (H, W, 3) float32,
    the top eigenvector of sum h h^T over all of them (Chen et al. 2006).
    """

    normals: np.ndarray
    weight: np.ndarray
    spread: np.ndarray
    count: np.ndarray
    observations: np.ndarray
    winner: np.ndarray


def thresholds(static: np.ndarray, white: float, share: float = 0.85) -> np.ndarray:
    """Luma (H, W), of the frames' dtype, above which a pixel counts as lit.

    static (H, W): the pixel's own level without the lamp; white: level of clipped highlights. `share` is how far from
    the one to the other a highlight must reach: a picture behind the glass is no highlight, however bright.
    """
    level = static + share * np.maximum(white - static.astype(np.float64), 0.02 * white)
    return np.floor(level).astype(static.dtype)


def white_level(brightest: np.ndarray, static: np.ndarray) -> float:
    """Level of the highlights from temporal maximum and static level (N,) of the object's pixels.

    Raises UnusableCapture where nothing glints.
    """
    top = float(np.iinfo(brightest.dtype).max)
    white, dark = float(np.percentile(brightest, 95.0)), float(np.median(static))
    if dark >= 0.93 * top:
        raise UnusableCapture(
            f"the object is saturated all the time (its static level is {dark:.0f} of {top:.0f})",
            "lower the exposure until only the highlights clip, and darken the room",
        )
    if white - dark < 0.12 * top:
        raise UnusableCapture(
            f"the object never glints (its brightest level is {white:.0f}, its static one {dark:.0f}, of {top:.0f})",
            "move a bright lamp around the object, expose so that its highlights clip, and check the region",
        )
    return white


def light_shares(half_vectors: np.ndarray, within: float = 1.0) -> np.ndarray:
    """Weight (T,) float32 of each frame: one over the number of frames within so many degrees; 0 without light.

    The hand lingers: without it a place where it rested would outvote the rest of the sweep.
    """
    shares = np.zeros(len(half_vectors), np.float32)
    known = np.isfinite(half_vectors[:, 0])
    if known.any():
        tree = cKDTree(half_vectors[known])
        chord = 2.0 * np.sin(np.radians(within) / 2.0)
        shares[known] = 1.0 / tree.query_ball_point(half_vectors[known], chord, return_length=True)
    return shares


def cluster_pixels(
    frames: np.ndarray,
    bars: np.ndarray,
    half_vectors: np.ndarray,
    shares: np.ndarray,
    *,
    clusters: int = 3,
    radius: float = 2.2,
    apart: float = 1.6,
) -> Clusters:
    """Clusters of a tile.

    frames (T, H, W) uint8 or uint16; bars (H, W), same dtype, from `thresholds` (the dtype's largest value leaves a
    pixel out); half_vectors (T, 3) float32, NaN where the frame was rejected; shares (T,) float32 from `light_shares`;
    radius: of a lamp's disc in degrees; apart: least distance in radii of another cluster's highlights.
    """
    length, height, width = frames.shape
    usable = np.flatnonzero(np.isfinite(half_vectors[:, 0]))
    starts, lit = _collect(frames.reshape(length, height * width), usable, bars.reshape(-1))
    cells, size = _cells(half_vectors)
    normals, weight, spread, count, winner = _cluster(
        starts, lit, half_vectors, shares, cells, size, clusters, np.radians(radius), apart
    )
    shape = (clusters, height, width)
    return Clusters(
        normals.reshape(*shape, 3),
        weight.reshape(shape),
        spread.reshape(shape),
        count.reshape(shape),
        np.diff(starts).astype(np.int32).reshape(height, width),
        winner.reshape(height, width, 3),
    )


def _cells(half_vectors: np.ndarray) -> tuple[np.ndarray, int]:
    """Cell (T,) int32 of each half vector in an equal-area map of the hemisphere, and the map's edge in cells."""
    cell = np.radians(CELL)
    size = int(np.ceil(2.0 * np.sqrt(2.0) / cell)) + 5
    known = np.where(np.isfinite(half_vectors), half_vectors, (0.0, 0.0, 1.0))
    plane = known[:, :2] / np.sqrt(np.maximum((1.0 + known[:, 2:]) / 2.0, 1e-9))
    column, row = np.floor(plane / cell + size / 2).astype(np.int32).clip(2, size - 3).T
    return row * size + column, size


@njit(cache=True, nogil=True)
def _collect(frames: np.ndarray, usable: np.ndarray, bars: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames in which each pixel is lit: those of pixel i are lit[starts[i] : starts[i + 1]], in order.

    A frame is compared at the speed of memory, then searched eight pixels at a time: hardly any are lit.
    """
    pixels = frames.shape[1]
    words = np.zeros(-(-pixels // 8), np.uint64)
    above = words.view(np.uint8)
    room = max(1024, pixels)
    who, when = np.empty(room, np.int32), np.empty(room, np.int32)
    found = 0
    starts = np.zeros(pixels + 1, np.int64)
    for t in usable:
        row = frames[t]
        for i in range(pixels):
            above[i] = row[i] > bars[i]
        if found + pixels > room:
            room = 2 * room + pixels
            who, when = _grown(who, room), _grown(when, room)
        for word in range(len(words)):
            if words[word] == 0:
                continue
            for i in range(8 * word, 8 * word + 8):
                if above[i]:
                    who[found], when[found] = i, t
                    found += 1
                    starts[i + 1] += 1
    for i in range(pixels):
        starts[i + 1] += starts[i]
    end = starts[:pixels].copy()
    lit = np.empty(found, np.int32)
    for k in range(found):
        lit[end[who[k]]] = when[k]
        end[who[k]] += 1
    return starts, lit


@njit(cache=True, nogil=True)
def _grown(values: np.ndarray, room: int) -> np.ndarray:
    larger = np.empty(room, values.dtype)
    larger[: len(values)] = values
    return larger


@njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract", "reassoc"})
def _cluster(
    starts: np.ndarray,
    lit: np.ndarray,
    half_vectors: np.ndarray,
    shares: np.ndarray,
    cells: np.ndarray,
    size: int,
    kept: int,
    radius: float,
    apart: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    pixels = len(starts) - 1
    normals = np.full((kept, pixels, 3), np.nan, np.float32)
    weight = np.zeros((kept, pixels), np.float32)
    spread = np.full((kept, pixels), np.nan, np.float32)
    count = np.zeros((kept, pixels), np.int32)
    winner = np.full((pixels, 3), np.nan, np.float32)
    density = np.zeros(size * size, np.float32)
    near, clear = np.cos(radius), np.cos(apart * radius)
    for pixel in range(pixels):
        frames = lit[starts[pixel] : starts[pixel + 1]]
        if len(frames) == 0:
            continue
        h, w = half_vectors[frames], shares[frames]
        _top_eigenvector(h, winner[pixel])
        for k in range(kept):
            first, last = _densest(cells[frames], w, density, size, k == 0)
            if first < 0:
                break
            centre = h[first].copy()
            if h[first, 0] * h[last, 0] + h[first, 1] * h[last, 1] + h[first, 2] * h[last, 2] > near:
                centre += h[last]
                centre /= np.sqrt((centre**2).sum())
            for _ in range(6):
                x = y = z = np.float32(0.0)
                for i in range(len(w)):
                    if w[i] > 0 and h[i, 0] * centre[0] + h[i, 1] * centre[1] + h[i, 2] * centre[2] > near:
                        x += w[i] * h[i, 0]
                        y += w[i] * h[i, 1]
                        z += w[i] * h[i, 2]
                length = np.sqrt(x * x + y * y + z * z)
                if length == 0:
                    break
                centre[0], centre[1], centre[2] = x / length, y / length, z / length
            total = square = np.float32(0.0)
            for i in range(len(w)):
                cosine = h[i, 0] * centre[0] + h[i, 1] * centre[1] + h[i, 2] * centre[2]
                if w[i] > 0 and cosine > near:
                    total += w[i]
                    square += w[i] * 2.0 * (1.0 - cosine)
                    count[k, pixel] += 1
                if w[i] > 0 and cosine > clear:
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
    """The first and the last highlight around which a disc of five cells across holds the most weight; -1 if none is
    left. Of the many that see the same disc, either alone would draw it along the lamp's way."""
    if fill:
        for i in range(len(cells)):
            density[cells[i]] += w[i]
    first, last, most = -1, -1, np.float32(0.0)
    for i in range(len(cells)):
        if w[i] <= 0:
            continue
        cell = cells[i]
        if i > 0 and cells[i - 1] == cell and w[i - 1] > 0:
            if last == i - 1:
                last = i
            continue
        total = np.float32(0.0)
        for row in range(-2, 3):
            reach = 1 if abs(row) == 2 else 2
            for column in range(-reach, reach + 1):
                total += density[cell + row * size + column]
        if total > most * np.float32(1.0001):
            first, most = i, total
        if total >= most * np.float32(0.9999):
            last = i
    return first, last


@njit(cache=True, nogil=True)
def _top_eigenvector(h: np.ndarray, vector: np.ndarray) -> None:
    """Of sum h h^T over rows (M, 3), turned towards the camera, by powers of the matrix; written to `vector` (3,)."""
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(len(h)):
        xx += h[i, 0] * h[i, 0]
        xy += h[i, 0] * h[i, 1]
        xz += h[i, 0] * h[i, 2]
        yy += h[i, 1] * h[i, 1]
        yz += h[i, 1] * h[i, 2]
        zz += h[i, 2] * h[i, 2]
    x, y, z = xz, yz, zz
    for _ in range(30):
        u, v, w = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
        scale = 1.0 / np.sqrt(u * u + v * v + w * w)
        u, v, w = u * scale, v * scale, w * scale
        still = abs(u - x) + abs(v - y) + abs(w - z) < 1e-7
        x, y, z = u, v, w
        if still:
            break
    vector[0], vector[1], vector[2] = x, y, z
