"""Response around a highlight: how bright a pixel stays when the light moves away from where it lights the pixel most.

A surface that mirrors shows the light itself: once the half vector is farther from the normal than the light's own
disc, the pixel is as dark as without the light. What scatters the light is shaded: its brightness falls with the cosine
of the light's angle and is still high 12 degrees of half vector beside its maximum (Nayar, Ikeuchi and Kanade 1991 call
the two specular spike and diffuse lobe). The ratio is a property of the surface, whatever its brightness, the exposure,
and the number of lights.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

RING_INNER_DEG, RING_OUTER_DEG = 4.5, 12.0
"""Half vectors at this angle from a lit frame's: beyond the disc of a usual light, and near enough for shading."""
RING_FRAMES = 24
"""Most frames of a ring that are looked at: enough for a mean, and cheap."""
DISTANT_FRAMES = 24
"""Frames spread over the sweep that give a pixel's level without the light."""
DARK_QUANTILE = 0.25
"""Quantile of these that is the dark level: shading reaches it in shadow, and an arm before the object seldom does."""
LIT_FRAMES = 4
"""Lit frames of a candidate whose rings are looked at."""


@dataclass(frozen=True, slots=True)
class Rings:
    """Frames to compare with, negative indices meaning none.

    around: (T, RING_FRAMES) int32, those whose half vector lies in the ring of each frame's; distant: (DISTANT_FRAMES,)
    int32, spread over the sweep.
    """

    around: np.ndarray
    distant: np.ndarray


def find_rings(half_vectors: np.ndarray, weights: np.ndarray) -> Rings:
    """Choose the frames to compare each frame with, at random but the same at each call.

    half_vectors: (T, 3), NaN where the frame was rejected; weights: (T,), by which places count instead of frames.
    """
    usable = np.flatnonzero(weights > 0)
    # Weighted sampling without replacement (Efraimidis and Spirakis 2006): ascending exponential variates over weights.
    order = usable[np.argsort(np.random.default_rng(0).exponential(size=len(usable)) / weights[usable])].astype(
        np.int32
    )
    cosines = np.cos(np.radians([RING_INNER_DEG, RING_OUTER_DEG]))
    around = _rings(np.nan_to_num(half_vectors).astype(np.float32), order, *cosines.astype(np.float32))
    return Rings(around, order[:DISTANT_FRAMES])


@njit(cache=True, nogil=True)
def _rings(half_vectors: np.ndarray, order: np.ndarray, cos_inner: float, cos_outer: float) -> np.ndarray:
    """Return the first RING_FRAMES frames of `order` in the ring of each frame: (T, RING_FRAMES) int32, -1 for none."""
    around = np.full((len(half_vectors), RING_FRAMES), -1, np.int32)
    for i in order:
        found = 0
        for j in order:
            cosine = (
                half_vectors[i, 0] * half_vectors[j, 0]
                + half_vectors[i, 1] * half_vectors[j, 1]
                + half_vectors[i, 2] * half_vectors[j, 2]
            )
            if cos_outer < cosine < cos_inner:
                around[i, found] = j
                found += 1
                if found == RING_FRAMES:
                    break
    return around


@njit(cache=True, nogil=True)
def surround_response(
    frames: np.ndarray,
    starts: np.ndarray,
    lit: np.ndarray,
    half_vectors: np.ndarray,
    normals: np.ndarray,
    around: np.ndarray,
    distant: np.ndarray,
    cos_radius: float,
) -> np.ndarray:
    """Measure how bright pixels are in the rings around their candidates' lit frames.

    Args:
        frames: (T, N) uint8 or uint16.
        starts, lit: lit frames of each pixel, from `collect_lit_frames`.
        half_vectors: (T, 3).
        normals: (K, N, 3) candidates, NaN where there are fewer.
        around, distant: of `Rings`.
        cos_radius: cosine of the radius of a candidate's disc.

    Returns:
        (K, N) float32, mean level there between dark (0) and that of the lit frames (1); NaN where there is no candidate
        or no frame in the rings.
    """
    candidates, pixels = normals.shape[:2]
    result = np.full((candidates, pixels), np.nan, np.float32)
    levels = np.empty(len(distant), np.float32)
    for pixel in range(pixels):
        if starts[pixel] == starts[pixel + 1]:
            continue
        for i in range(len(distant)):
            levels[i] = frames[distant[i], pixel]
        dark = np.sort(levels)[int(DARK_QUANTILE * (len(levels) - 1))]
        members = lit[starts[pixel] : starts[pixel + 1]]
        for k in range(candidates):
            normal = normals[k, pixel]
            if np.isnan(normal[0]):
                break
            h = half_vectors[members]
            own = members[h[:, 0] * normal[0] + h[:, 1] * normal[1] + h[:, 2] * normal[2] > cos_radius]
            step = max(1, -(-len(own) // LIT_FRAMES))
            total, count = np.float32(0.0), 0
            for frame in own[::step]:
                rise = max(np.float32(frames[frame, pixel]) - dark, np.float32(1.0))
                for ring_frame in around[frame]:
                    if ring_frame < 0:
                        break
                    response = (np.float32(frames[ring_frame, pixel]) - dark) / rise
                    total += min(max(response, np.float32(0.0)), np.float32(1.0))
                    count += 1
            if count > 0:
                result[k, pixel] = total / np.float32(count)
    return result
