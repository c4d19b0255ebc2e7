"""Segmentation of bright blobs in frames of a chrome sphere, and the mean direction that each blob reflects.

Hysteresis thresholding (Canny 1986) by flood fill: a blob is connected above a lower level and exceeds an upper level
somewhere. Compiled, since it visits every pixel of every frame.
"""

import numpy as np
from numba import njit

MAX_BLOBS = 4
"""Bright blobs kept per frame: those of lights before the object first, larger ones first."""

LARGE_BLOB_PX, CORE_EDGE_LEVEL = 150.0, 0.8
"""Blobs of more pixels are measured by their core above this level, which holds the least glare; small ones need the
soft boundary for subpixel accuracy."""

MAX_TRIM_ITERATIONS = 20
"""Limit of the iterations in which a blob's centre and area settle without its glare."""


@njit(cache=True, nogil=True)
def _trimmed_sum(
    pixels: np.ndarray,
    levels: np.ndarray,
    directions: np.ndarray,
    width: int,
    edge_level: float,
    full_level: float,
    trim_ratio: float,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Return the weighted sum (3,) of a blob's reflected directions, its weighted area, and its weighted covariance of
    columns and rows (xx, xy, yy), without glare.

    pixels (N,): flat indices of the blob; levels (N,): from background (0) to saturation (1). Only pixels within
    `trim_ratio` radii of the blob's centre count, the radius being that of a disc of its area. Centre and area are
    iterated from the whole blob, so glare streaks drop out step by step.
    """
    limit = np.inf
    column = row = area = 0.0
    total, squares = np.zeros(3), np.zeros(3)
    for _ in range(MAX_TRIM_ITERATIONS):
        before = area
        total[:], squares[:] = 0.0, 0.0
        area = u = v = 0.0
        for k in range(pixels.size):
            i, j = pixels[k] // width, pixels[k] % width
            if (i - row) ** 2 + (j - column) ** 2 > limit:
                continue
            weight = min(max((levels[k] - edge_level) / (full_level - edge_level), 0.0), 1.0)
            for axis in range(3):
                total[axis] += weight * directions[i, j, axis]
            u += weight * j
            v += weight * i
            squares[0] += weight * j * j
            squares[1] += weight * j * i
            squares[2] += weight * i * i
            area += weight
        if area <= 0.0:
            break
        column, row = u / area, v / area
        limit = (trim_ratio**2 * area) / np.pi + 1.0
        if abs(area - before) < 1e-6 * area:
            break
    if area > 0.0:
        squares = squares / area - np.array([column * column, column * row, row * row])
    return total, area, squares


@njit(cache=True, nogil=True)
def _fill_blob(
    frame: np.ndarray,
    background: np.ndarray,
    gain: np.ndarray,
    occluded: np.ndarray,
    edge_level: float,
    row: int,
    column: int,
    t: int,
    assigned: np.ndarray,
    pixels: np.ndarray,
    levels: np.ndarray,
) -> tuple[int, float]:
    """Flood-fill the blob (8-connected) of a pixel of frame t; write its pixels and levels.

    Returns:
        The number of pixels written, and that of hidden ones: occluded neighbours and pixels at the image's edge.
    """
    height, width = frame.shape
    hidden = 0.0
    pixels[0] = row * width + column
    levels[0] = (frame[row, column] - background[row, column]) * gain[row, column]
    assigned[row, column] = t
    # `pixels` is both the queue and the result: entries before `done` have had their neighbours visited.
    size, done = 1, 0
    while done < size:
        i, j = pixels[done] // width, pixels[done] % width
        done += 1
        if i == 0 or j == 0 or i == height - 1 or j == width - 1:
            hidden += 1.0
        for a in range(max(i - 1, 0), min(i + 2, height)):
            for b in range(max(j - 1, 0), min(j + 2, width)):
                if assigned[a, b] == t:
                    continue
                if occluded[a, b]:
                    assigned[a, b] = t
                    hidden += 1.0
                else:
                    level = (frame[a, b] - background[a, b]) * gain[a, b]
                    if level > edge_level:
                        assigned[a, b] = t
                        pixels[size] = a * width + b
                        levels[size] = level
                        size += 1
    return size, hidden


@njit(cache=True, nogil=True)
def _insert_blob(
    total: np.ndarray,
    area: np.ndarray,
    hidden: np.ndarray,
    spread: np.ndarray,
    blob_total: np.ndarray,
    blob_area: float,
    blob_hidden: float,
    blob_spread: np.ndarray,
) -> None:
    """Insert a blob into a frame's sorted arrays (B, 3), (B,), (B,), (B, 3): lights before the object first, then by
    area."""
    is_front = blob_total[2] >= 0.0
    for slot in range(MAX_BLOBS):
        is_slot_front = total[slot, 2] >= 0.0 and area[slot] > 0.0
        if (
            area[slot] == 0.0
            or (is_front and not is_slot_front)
            or (is_front == is_slot_front and blob_area > area[slot])
        ):
            for later in range(MAX_BLOBS - 1, slot, -1):
                total[later] = total[later - 1]
                area[later] = area[later - 1]
                hidden[later] = hidden[later - 1]
                spread[later] = spread[later - 1]
            total[slot], spread[slot] = blob_total, blob_spread
            area[slot], hidden[slot] = blob_area, blob_hidden
            break


@njit(cache=True, nogil=True)
def measure_blobs(
    frames: np.ndarray,
    background: np.ndarray,
    gain: np.ndarray,
    peaks: np.ndarray,
    occluded: np.ndarray,
    directions: np.ndarray,
    edge_level: float,
    full_level: float,
    trim_ratio: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Measure the blobs of frames (T, h, w) uint8 or uint16, at most B = `MAX_BLOBS` per frame.

    A pixel's level is (luma - background) * gain.

    Args:
        frames: in C order.
        background: (h, w) float32.
        gain: (h, w) float32; 0 where a pixel is not read.
        peaks: (h, w) float32, luma above which a blob begins.
        occluded: (h, w) bool, pixels whose background is too bright to show the light.
        directions: (h, w, 3), what each pixel reflects.
        edge_level: level above which a blob is connected, and where a pixel's weight begins.
        full_level: level from which a pixel's weight is 1.
        trim_ratio: radius about a blob's centre, in radii of a disc of its area, beyond which pixels are glare.

    Returns:
        Each blob's weighted sum of directions (T, B, 3), area (T, B), number of hidden pixels (T, B), and covariance
        of columns and rows (T, B, 3) as xx, xy, yy in square pixels; zero where there is no blob.
    """
    count, height, width = frames.shape
    total = np.zeros((count, MAX_BLOBS, 3))
    area = np.zeros((count, MAX_BLOBS))
    hidden = np.zeros((count, MAX_BLOBS))
    spread = np.zeros((count, MAX_BLOBS, 3))
    # Frame in which a pixel was last assigned to a blob; as frames are numbered, it needs no clearing between them.
    assigned = np.full((height, width), -1, np.int64)
    pixels = np.empty(height * width, np.int64)
    levels = np.empty(height * width)
    for t in range(count):
        for row in range(height):
            for column in range(width):
                if frames[t, row, column] <= peaks[row, column] or assigned[row, column] == t:
                    continue
                size, blob_hidden = _fill_blob(
                    frames[t], background, gain, occluded, edge_level, row, column, t, assigned, pixels, levels
                )
                low, high = edge_level, full_level
                if size > LARGE_BLOB_PX:
                    low, high = CORE_EDGE_LEVEL, 1.0
                blob_total, blob_area, blob_spread = _trimmed_sum(
                    pixels[:size], levels[:size], directions, width, low, high, trim_ratio
                )
                _insert_blob(total[t], area[t], hidden[t], spread[t], blob_total, blob_area, blob_hidden, blob_spread)
    return total, area, hidden, spread
