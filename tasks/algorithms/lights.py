"""Light and half vector of every frame from the highlight on a mirror ball (paper, section 3: orientation consistency).

The normal of the ball where it shows the lamp is the half vector H of the lamp L and the view V = (0, 0, 1), and it is
what a highlighted object pixel receives as candidate normal. Three steps, so that a long video passes through in blocks:
`static_level` of a sample of the frames, `measure_highlights` of each block, `decide_lights` over all of them;
`find_lights` is the three in a row.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from tasks.algorithms.errors import UnusableCapture
from tasks.algorithms.geometry import angles, half_vectors_of, unit
from tasks.algorithms.spheres import Sphere

REASONS = ("accepted", "no light", "behind the object", "two lights", "clipped or ambiguous", "outside the sphere")
"""Words of the codes in `Lights.reason`."""
ACCEPTED, NO_LIGHT, BEHIND, TWO_LIGHTS, AMBIGUOUS, OUTSIDE = range(len(REASONS))

CANDIDATES = 4
"""Bright blobs kept per frame, those of lights before the object first, larger ones first."""

BROAD, CORE_LOW = 150.0, 0.8
"""Blobs of more pixels than `BROAD` need no grey outline: their core above `CORE_LOW` is the freest of glare."""

BEHIND_NZ = float(np.cos(np.radians(45.0)))
"""n_z of the ball's normal below which the light is more than 90 degrees from the view vector."""

REMEDY = "keep the lamp lit and its reflection visible on the sphere, expose so that only the highlights clip"


@dataclass(frozen=True, slots=True)
class StaticLevel:
    """What does not move on the ball: `level` (h, w) float32 and `white`, the level of the lamp's highlight."""

    level: np.ndarray
    white: float
    noise: float


@dataclass(frozen=True, slots=True)
class Highlights:
    """Bright blobs per frame: light (T, B, 3) unit or NaN, extent (T, B) in pixels, blind (T, B) share of unreadable pixels."""

    light: np.ndarray
    extent: np.ndarray
    blind: np.ndarray


@dataclass(frozen=True, slots=True)
class Lights:
    """half_vectors and lights (T, 3) float32 in the camera frame, NaN where rejected; reason (T,) uint8 into REASONS.

    `extent` (T,) float32 is the area in pixels of each accepted highlight; `disagreement` (T,) float32 the largest
    angle in degrees between any one sphere's half vector and the combined one (NaN with a single sphere).
    """

    half_vectors: np.ndarray
    lights: np.ndarray
    reason: np.ndarray
    extent: np.ndarray
    disagreement: np.ndarray

    @property
    def accepted(self) -> np.ndarray:
        """(T,) bool: frames with a light."""
        return self.reason == ACCEPTED


def static_level(sample: np.ndarray, sphere: Sphere, *, percentile: float = 30.0) -> StaticLevel:
    """Static reflections of the ball from a sample of frames (S, h, w), evenly spread over the capture.

    A low percentile is used since the hand lingers. One frame has no static part, a few have their minimum.
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
    inside = _slope(sphere, frames.shape[1:]) < 0.75
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
) -> Highlights:
    """Bright blobs on the ball in a block of frames (T, h, w) uint8 or uint16.

    Brightness is measured between the static level (0) and white (1): a blob is connected above `low` and exceeds
    `seed` somewhere; a pixel's weight rises from 0 at `low` to 1 at `high`, which makes its outline sub-pixel. Under
    an orthographic camera every pixel of a mirror ball shows the same solid angle of the surroundings (4 / radius^2
    steradians), so the weighted mean of the directions that the pixels mirror is the lamp's centre without bias from
    the ball's distortion, and the lamp covers the same area wherever it is.
    """
    frames = np.ascontiguousarray(frames)
    if frames.ndim != 3 or frames.shape[1:] != static.level.shape:
        raise ValueError(f"frames have shape {frames.shape}, the static level {static.level.shape}")
    slope = _slope(sphere, frames.shape[1:])
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
        _mirrored(sphere, frames.shape[1:]),
        low,
        high,
        reach,
    )
    total, extent, bad = result
    return Highlights(unit(total).astype(np.float32), extent, bad / np.maximum(extent, 1.0))


def decide_lights(
    highlights: Sequence[Highlights], static: StaticLevel, sphere: Sphere, *, second: float = 0.5, odd: float = 3.0
) -> Lights:
    """One light per frame or the reason why there is none, from the blobs of all blocks in order.

    Two blobs before the object are two lights where the second has at least `second` of the first one's area; an
    area that differs from the capture's median by more than `odd` times is ambiguous (the lamp's area is constant).
    """
    light = np.concatenate([block.light for block in highlights])
    extent = np.concatenate([block.extent for block in highlights])
    blind = np.concatenate([block.blind for block in highlights])
    contrast = static.white - float(np.median(static.level))
    if contrast < max(12.0, 8.0 * static.noise) or not (extent > 0).any():
        raise UnusableCapture(
            f"no moving light on the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) in any of {len(light)} frames "
            f"(the brightest spot is {max(contrast, 0.0):.0f} levels above the static picture)",
            REMEDY,
        )
    half = half_vectors_of(light.astype(np.float64))
    front = (half[..., 2] >= BEHIND_NZ) & (extent > 0)
    reason = np.full(len(light), ACCEPTED, np.uint8)
    usual = float(np.median(extent[:, 0][front[:, 0]])) if front[:, 0].any() else 0.0
    inner_area = 0.5 * np.pi * sphere.radius**2
    unusual = (extent[:, 0] > odd * usual) | (extent[:, 0] < usual / odd)
    reason[unusual | (blind[:, 0] > 0.25)] = AMBIGUOUS
    reason[front[:, 1] & (extent[:, 1] >= second * np.maximum(extent[:, 0], usual))] = TWO_LIGHTS
    reason[~front[:, 0]] = BEHIND
    reason[~front[:, 0] & (half[:, 0, 2] < 0.2)] = OUTSIDE
    reason[extent[:, 0] > 0.25 * inner_area] = AMBIGUOUS
    reason[extent[:, 0] <= 0] = NO_LIGHT
    return _lights(half[:, 0], reason, extent[:, 0])


def find_lights(
    frames: np.ndarray, sphere: Sphere, *, block: int = 1024, sample: int = 200, **parameters: float
) -> Lights:
    """Lights of frames (T, h, w) uint8 or uint16 cropped around a sphere given in the crop's pixels.

    Parameters are those of `static_level`, `measure_highlights` and `decide_lights` by name.
    Raises UnusableCapture where no frame shows a light.
    """
    steps = np.unique(np.linspace(0, len(frames) - 1, min(sample, len(frames))).round().astype(int))
    static = static_level(frames[steps], sphere, **_only(parameters, "percentile"))
    measuring = _only(parameters, "seed", "low", "high", "reach")
    blocks = [
        measure_highlights(frames[start : start + block], sphere, static, **measuring)
        for start in range(0, len(frames), block)
    ]
    return decide_lights(blocks, static, sphere, **_only(parameters, "second", "odd"))


def _lights(half: np.ndarray, reason: np.ndarray, extent: np.ndarray, disagreement: np.ndarray | None = None) -> Lights:
    half = np.where((reason == ACCEPTED)[:, None], half, np.nan)
    lights = 2.0 * half[:, 2:] * half - np.array([0.0, 0.0, 1.0])
    if disagreement is None:
        disagreement = np.full(len(half), np.nan, np.float32)
    return Lights(
        half.astype(np.float32),
        lights.astype(np.float32),
        reason.astype(np.uint8),
        extent.astype(np.float32),
        disagreement,
    )


def _only(parameters: dict[str, float], *names: str) -> dict[str, float]:
    return {name: parameters[name] for name in names if name in parameters}


def _offsets(sphere: Sphere, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius


def _slope(sphere: Sphere, shape: tuple[int, ...]) -> np.ndarray:
    return np.hypot(*_offsets(sphere, shape))


def _mirrored(sphere: Sphere, shape: tuple[int, ...]) -> np.ndarray:
    nx, ny = _offsets(sphere, shape)
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    return np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0], axis=-1)


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


def disagreement_of(lights: Lights) -> tuple[float, float]:
    """Median and 95th percentile in degrees of the spheres' disagreement; NaN where no frame has two spheres."""
    known = lights.disagreement[np.isfinite(lights.disagreement)]
    return (float(np.median(known)), float(np.percentile(known, 95.0))) if known.size else (np.nan, np.nan)


def combine_lights(per_sphere: Sequence[Lights], *, tolerance: float = 5.0) -> Lights:
    """Lights of several spheres as one: the mean half vector of those that accept the frame.

    A frame whose spheres lie further than `tolerance` degrees from their mean is ambiguous; a frame that no sphere
    accepts keeps the first sphere's reason.
    """
    if not per_sphere:
        raise ValueError("no lights to combine")
    if len({len(lights.reason) for lights in per_sphere}) != 1:
        raise ValueError(f"frames differ: {[len(lights.reason) for lights in per_sphere]}")
    if len(per_sphere) == 1:
        return per_sphere[0]
    stack = np.stack([lights.half_vectors for lights in per_sphere]).astype(np.float64)
    accepted = np.stack([lights.accepted for lights in per_sphere])
    mean = unit(np.where(accepted[..., None], stack, 0.0).sum(axis=0))
    apart = np.where(accepted, angles(np.where(accepted[..., None], stack, mean), mean), 0.0).max(axis=0)
    several = accepted.sum(axis=0) > 1
    reason = np.where(accepted.any(axis=0), ACCEPTED, per_sphere[0].reason)
    reason[several & (apart > tolerance)] = AMBIGUOUS
    extent = np.where(accepted, [lights.extent for lights in per_sphere], 0.0).max(axis=0)
    return _lights(mean, reason, extent, np.where(several, apart, np.nan).astype(np.float32))
