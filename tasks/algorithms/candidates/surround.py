"""Shading of candidates: how bright a pixel stays when the light moves away from where it lights the pixel most.

A surface that mirrors shows the light itself: once the half vector is farther from the normal than the light's own
disc, the pixel is as dark as anywhere. What scatters the light is shaded: its brightness falls with the cosine of the
light's angle, hardly over 12 degrees of half vector and more over 30 (Nayar, Ikeuchi and Kanade 1991: specular spike
and diffuse lobe). The share of the fall from the lit frames to an outer ring that is left in an inner ring is a
property of the surface, whatever its brightness, what it shows besides, and the number of lights.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.candidates.lit_frames import LitFrames

INNER_RING_DEG = (4.5, 12.0)
"""Angles of half vectors from a lit frame's: beyond the disc of a usual light, and near enough for shading."""
OUTER_RING_DEG = (15.0, 30.0)
"""The same of frames that give the level without the highlight: shading has fallen by then."""
RING_FRAMES = 24
"""Largest number of frames of a ring that are looked at: enough for a mean, and cheap."""
MIN_OUTER_FRAMES = 3
"""Frames in the outer ring below which frames of the whole sweep take their place."""
DARK_QUANTILE = 0.25
"""Quantile of the levels in these that is the level without the highlight: shading has many levels."""
LIT_FRAMES = 4
"""Lit frames of a candidate whose rings are looked at."""


class Rings(NamedTuple):
    """Frames to compare with.

    inner, outer: (T, RING_FRAMES) int32, those whose half vector lies in the rings of each frame's, -1 where there are
    fewer; sweep: (RING_FRAMES,) int32 at most, spread over the sweep.
    """

    inner: np.ndarray
    outer: np.ndarray
    sweep: np.ndarray


def rings_deg(light_size: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the inner and the outer ring in degrees, of a light of this size relative to a usual one's.

    The disc that a larger light lights ends farther out, and both rings begin and end farther out by as much.
    """
    shift = (light_size - 1.0) * INNER_RING_DEG[0]
    inner, outer = ((least + shift, most + shift) for least, most in (INNER_RING_DEG, OUTER_RING_DEG))
    return inner, outer


def find_rings(half_vectors: np.ndarray, weights: np.ndarray, light_size: float = 1.0) -> Rings:
    """Choose the frames to compare each frame with, at random but the same at each call.

    half_vectors: (T, 3), NaN where the frame was rejected; weights: (T,), by which places count instead of frames;
    light_size: see `rings_deg`.
    """
    order = random_order(weights)
    inner, outer = (frames_between(half_vectors, order, *ring, RING_FRAMES) for ring in rings_deg(light_size))
    return Rings(inner, outer, order[:RING_FRAMES])


def random_order(weights: np.ndarray) -> np.ndarray:
    """Return the frames with a weight (T,) in a random order, the same at each call, heavy ones rather early: int32.

    Source: weighted sampling without replacement by exponential variates over the weights (Efraimidis and Spirakis
    2006).
    """
    usable = np.flatnonzero(weights > 0)
    variates = np.random.default_rng(0).exponential(size=len(usable)) / weights[usable]
    return usable[np.argsort(variates)].astype(np.int32)


def frames_between(
    half_vectors: np.ndarray, order: np.ndarray, least_deg: float, most_deg: float, count: int
) -> np.ndarray:
    """Return the first frames of an order whose half vectors lie between two angles from each frame's.

    half_vectors: (T, 3), NaN where the frame was rejected. Returns (T, count) int32, -1 where there are fewer.
    """
    vectors = np.nan_to_num(half_vectors).astype(np.float32)
    # No cosine exceeds the first bound where the frame itself and those beside it count, whatever the rounding.
    cos_least = 2.0 if least_deg == 0.0 else np.cos(np.radians(least_deg))
    return np.asarray(_frames_between(vectors, order, cos_least, np.cos(np.radians(most_deg)), count))


@njit(cache=True, nogil=True)
def _frames_between(
    half_vectors: np.ndarray, order: np.ndarray, cos_least: float, cos_most: float, most: int
) -> np.ndarray:
    """Return the first `most` frames of `order` between two cosines from each frame: (T, most) int32, -1 for none."""
    ring = np.full((len(half_vectors), most), -1, np.int32)
    for i in order:
        count = 0
        for j in order:
            cosine = (
                half_vectors[i, 0] * half_vectors[j, 0]
                + half_vectors[i, 1] * half_vectors[j, 1]
                + half_vectors[i, 2] * half_vectors[j, 2]
            )
            if cos_most < cosine < cos_least:
                ring[i, count] = j
                count += 1
                if count == most:
                    break
    return ring


@njit(cache=True, nogil=True)
def candidate_shading(
    frames: np.ndarray,
    lit: LitFrames,
    half_vectors: np.ndarray,
    normals: np.ndarray,
    cos_radius: float,
    rings: Rings,
) -> np.ndarray:
    """Measure the shading of candidates: how bright pixels are in the rings around their lit frames.

    Args:
        frames: (T, N) uint8 or uint16.
        lit: lit frames of each pixel.
        half_vectors: (T, 3).
        normals: (K, N, 3) candidates, NaN where there are fewer.
        cos_radius: cosine of the radius of a candidate's disc.
        rings: frames to compare each frame with.

    Returns:
        (K, N) float32, mean level in the inner ring, from that without the highlight (0) to that of the lit frames (1);
        NaN where there is no candidate or no frame in the inner ring.
    """
    candidates, pixels = normals.shape[:2]
    result = np.full((candidates, pixels), np.nan, np.float32)
    inner, outer, sweep = rings
    levels = np.empty(len(sweep), np.float32)
    for pixel in range(pixels):
        start, end = lit.starts[pixel], lit.starts[pixel + 1]
        if start == end:
            continue
        for i in range(len(sweep)):
            levels[i] = frames[sweep[i], pixel]
        sweep_level = np.sort(levels)[int(DARK_QUANTILE * (len(levels) - 1))]
        members, brightness = lit.frames[start:end], lit.brightness[start:end]
        for k in range(candidates):
            normal = normals[k, pixel]
            if np.isnan(normal[0]):
                break
            h = half_vectors[members]
            near = h[:, 0] * normal[0] + h[:, 1] * normal[1] + h[:, 2] * normal[2] > cos_radius
            # Dim frames, at the edge of the highlight, have risen too little to be compared with.
            own = members[near & (brightness >= (brightness * near).max() / 2.0)]
            step = max(1, -(-len(own) // LIT_FRAMES))
            total, count = 0.0, 0
            for frame in own[::step]:
                dark, outer_count = _mean_level(frames, pixel, outer[frame])
                if outer_count < MIN_OUTER_FRAMES:
                    dark = sweep_level
                rise = max(frames[frame, pixel] - dark, 1.0)
                for ring_frame in inner[frame]:
                    if ring_frame < 0:
                        break
                    total += min(max((frames[ring_frame, pixel] - dark) / rise, 0.0), 1.0)
                    count += 1
            if count > 0:
                result[k, pixel] = total / count
    return result


@njit(cache=True, nogil=True)
def _mean_level(frames: np.ndarray, pixel: int, ring: np.ndarray) -> tuple[float, int]:
    """Return a pixel's mean level in the frames of a ring, and their number."""
    total, count = 0.0, 0
    for frame in ring:
        if frame < 0:
            break
        total += frames[frame, pixel]
        count += 1
    return total / max(count, 1), count
