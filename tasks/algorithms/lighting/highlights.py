"""Bright blobs of a moving lamp on a mirror ball, frame by frame, in spite of what the ball mirrors all the time."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import cone_of, views
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.lighting.spheres import Sphere

CANDIDATES = 4
"""Bright blobs kept per frame, those of lights before the object first, larger ones first."""

BROAD, CORE_LOW = 150.0, 0.8
"""Blobs of more pixels than `BROAD` need no grey outline: their core above `CORE_LOW` is the freest of glare."""

REMEDY = "keep the lamp lit and its reflection visible on the sphere, expose so that only the highlights clip"


@dataclass(frozen=True, slots=True)
class StaticLevel:
    """What does not move on the ball: `level` (h, w) float32 and `white`, the level of the lamp's highlight."""

    level: np.ndarray
    white: float
    noise: float


@dataclass(frozen=True, slots=True)
class Highlights:
    """Bright blobs per frame: light (T, B, 3) unit or NaN, extent (T, B) in pixels, blind (T, B) share unreadable."""

    light: np.ndarray
    extent: np.ndarray
    blind: np.ndarray


def static_level(
    sample: np.ndarray, sphere: Sphere, *, percentile: float = 30.0, camera: np.ndarray | None = None
) -> StaticLevel:
    """Static reflections of the ball from a sample of frames (S, h, w), evenly spread over the capture.

    A low percentile is used since the hand lingers. One frame has no static part, a few have their minimum. camera: as
    in `measure_highlights`.
    """
    frames = np.asarray(sample)
    if frames.ndim != 3 or len(frames) == 0:
        raise ValueError(f"sample has shape {frames.shape}, expected (frames, rows, columns) with at least one frame")
    if len(frames) == 1:
        level = np.zeros(frames.shape[1:], np.float32)
    elif len(frames) < 6:
        level = frames.min(axis=0).astype(np.float32)
    else:
        level = np.percentile(frames, percentile, axis=0).astype(np.float32)
    inside = _seen(sphere, frames.shape[1:], camera)[0] < 0.75
    if not inside.any():
        raise UnusableCapture(f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) lies outside its frames", REMEDY)
    peaks = frames[:, inside].max(axis=1)
    residual = frames[:, inside].astype(np.float32) - level[inside]
    noise = 1.4826 * float(np.median(np.abs(residual - np.median(residual)))) if len(frames) > 5 else 0.0
    return StaticLevel(level, float(np.percentile(peaks, 75.0)), noise)


def measure_highlights(
    frames: np.ndarray,
    sphere: Sphere,
    static: StaticLevel,
    *,
    seed: float = 0.6,
    low: float = 0.25,
    high: float = 0.75,
    reach: float = 1.3,
    camera: np.ndarray | None = None,
) -> Highlights:
    """Bright blobs on the ball in a block of frames (T, h, w) uint8 or uint16.

    Brightness is measured between the static level (0) and white (1): a blob is connected above `low` and exceeds
    `seed` somewhere; a pixel's weight rises from 0 at `low` to 1 at `high`, which makes its outline sub-pixel. Under
    an orthographic camera every pixel of a mirror ball shows the same solid angle of the surroundings (4 / radius^2
    steradians), so the weighted mean of the directions that the pixels mirror is the lamp's centre without bias from
    the ball's distortion, and the lamp covers the same area wherever it is. With a camera matrix (3, 3; pixels of these
    frames) every pixel mirrors its own ray, and this is nearly so.
    """
    frames = np.ascontiguousarray(frames)
    if frames.ndim != 3 or frames.shape[1:] != static.level.shape:
        raise ValueError(f"frames have shape {frames.shape}, the static level {static.level.shape}")
    slope, mirrored = _seen(sphere, frames.shape[1:], camera)
    room = static.white - static.level
    blind = room < 0.15 * static.white
    unseen = blind | (slope > 1.05)
    never = np.float32(np.inf)
    gain = np.where(unseen, 0.0, 1.0 / np.maximum(room, 1e-6)).astype(np.float32)
    least = np.where(unseen, never, static.level + seed * room).astype(np.float32)
    result = _measure(
        frames,
        static.level,
        gain,
        least,
        blind & (slope <= 1.05),
        mirrored,
        low,
        high,
        reach,
    )
    total, extent, bad = result
    return Highlights(unit(total).astype(np.float32), extent, bad / np.maximum(extent, 1.0))


def _seen(sphere: Sphere, shape: tuple[int, ...], camera: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Sine (h, w) of the angle between view and normal, above 1 beside the ball; directions (h, w, 3) mirrored."""
    if camera is not None:
        cone, view = cone_of(sphere.x, sphere.y, sphere.radius, camera), views(camera, shape, 0, 0)
        normals = cone.normals(view)
        return cone.slopes(view), 2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    return np.hypot(nx, ny), np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0], axis=-1)


@njit(cache=True, nogil=True)
def _trimmed(
    pixels: np.ndarray, values: np.ndarray, mirrored: np.ndarray, width: int, low: float, high: float, reach: float
) -> tuple[float, float, float, float]:
    """Weighted sum of mirrored directions and area, over the pixels within `reach` radii of the blob's own centre.

    The radius is that of a disc of the blob's area: glare streaks lie outside and drop out step by step.
    """
    limit = np.inf
    column = row = x = y = z = area = 0.0
    for _ in range(20):
        before = area
        x = y = z = area = u = v = 0.0
        for k in range(pixels.size):
            i, j = pixels[k] // width, pixels[k] % width
            if (i - row) ** 2 + (j - column) ** 2 > limit:
                continue
            weight = min(max((values[k] - low) / (high - low), 0.0), 1.0)
            x += weight * mirrored[i, j, 0]
            y += weight * mirrored[i, j, 1]
            z += weight * mirrored[i, j, 2]
            u += weight * j
            v += weight * i
            area += weight
        if area <= 0.0:
            break
        column, row = u / area, v / area
        limit = (reach**2 * area) / np.pi + 1.0
        if abs(area - before) < 1e-6 * area:
            break
    return x, y, z, area


@njit(cache=True, nogil=True)
def _measure(
    frames: np.ndarray,
    level: np.ndarray,
    gain: np.ndarray,
    least: np.ndarray,
    blind: np.ndarray,
    mirrored: np.ndarray,
    low: float,
    high: float,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    count, height, width = frames.shape
    total = np.zeros((count, CANDIDATES, 3))
    extent = np.zeros((count, CANDIDATES))
    bad = np.zeros((count, CANDIDATES))
    seen = np.full((height, width), -1, np.int64)
    stack = np.empty(height * width, np.int64)
    values = np.empty(height * width)
    for t in range(count):
        for row in range(height):
            for column in range(width):
                if frames[t, row, column] <= least[row, column] or seen[row, column] == t:
                    continue
                unread = 0.0
                stack[0] = row * width + column
                values[0] = (frames[t, row, column] - level[row, column]) * gain[row, column]
                seen[row, column] = t
                size, done = 1, 0
                while done < size:
                    i, j = stack[done] // width, stack[done] % width
                    done += 1
                    if i == 0 or j == 0 or i == height - 1 or j == width - 1:
                        unread += 1.0
                    for a in range(max(i - 1, 0), min(i + 2, height)):
                        for b in range(max(j - 1, 0), min(j + 2, width)):
                            if seen[a, b] == t:
                                continue
                            if blind[a, b]:
                                seen[a, b] = t
                                unread += 1.0
                            else:
                                value = (frames[t, a, b] - level[a, b]) * gain[a, b]
                                if value > low:
                                    seen[a, b] = t
                                    stack[size] = a * width + b
                                    values[size] = value
                                    size += 1
                if size > BROAD:
                    x, y, z, area = _trimmed(stack[:size], values[:size], mirrored, width, CORE_LOW, 1.0, reach)
                else:
                    x, y, z, area = _trimmed(stack[:size], values[:size], mirrored, width, low, high, reach)
                ahead = z >= 0.0
                for slot in range(CANDIDATES):
                    kept = total[t, slot, 2] >= 0.0 and extent[t, slot] > 0.0
                    if extent[t, slot] == 0.0 or (ahead and not kept) or (ahead == kept and area > extent[t, slot]):
                        for later in range(CANDIDATES - 1, slot, -1):
                            total[t, later] = total[t, later - 1]
                            extent[t, later] = extent[t, later - 1]
                            bad[t, later] = bad[t, later - 1]
                        total[t, slot, 0], total[t, slot, 1], total[t, slot, 2] = x, y, z
                        extent[t, slot], bad[t, slot] = area, unread
                        break
    return total, extent, bad
