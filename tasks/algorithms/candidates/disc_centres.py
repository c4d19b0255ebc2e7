"""Centres of the light's discs, by the frames that light a pixel and those that leave it dark.

The half vectors that light a pixel lie in a disc about its normal. The mean of the lit frames is off by as much as the
recording's half vectors are spread unevenly over that disc: a pass of the light crosses it anywhere, and at the edge of
the sweep only a part of it is reached. Dark frames tell where the disc ends. Its centre is the posterior mean over a
grid about the lit frames' mean; beforehand all centres, and radii from small to large, are equally likely. A frame
lights the pixel with a probability that falls from nearly one inside the disc to nearly zero outside.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.candidates.lit_frames import LitFrames
from glint.tasks.algorithms.candidates.surround import frames_between, random_order

DISC_SHARES = (0.21, 0.28, 0.37)
"""Radii of the disc, relative to the light's angular radius in a sphere: it grows with the light's brightness and with
the bend of the surface."""
EDGE_SHARE = 0.12
"""Width of the disc's edge (scale of a logistic function), as a share of its radius."""
LIT_OUTSIDE, DARK_INSIDE = 0.02, 0.03
"""Probabilities that a frame far outside the disc lights the pixel, by another path, and that one inside does not."""
GRID, GRID_REACH = 7, 1.1
"""Centres that are tried along either direction, and how far to both sides, in radii of the middle disc."""
AROUND_FRAMES, FRAMES_REACH = 64, 2.0
"""Largest number of frames that tell a centre, and how far from the nearest lit frame they lie, in such radii."""
TABLE_LENGTH = 512
"""Steps of the squared distance for which log-probabilities are kept."""


class DiscModel(NamedTuple):
    """Probability that a frame lights a pixel, by the distance of its half vector from the disc's centre.

    around: (T, AROUND_FRAMES) int32, frames near each frame, -1 where there are fewer. lit, dark: (TABLE_LENGTH, R)
    float32, log-probabilities for R radii that a frame lights the pixel, and that it does not, by the squared distance.
    reach: distance at the end of the tables. step: of the grid of centres. Both in radians.
    """

    around: np.ndarray
    lit: np.ndarray
    dark: np.ndarray
    reach: float
    step: float

    @classmethod
    def of_light(cls, light_radius: float, half_vectors: np.ndarray, weights: np.ndarray) -> "DiscModel":
        """Return the model for a recording of a light.

        Args:
            light_radius: the light's angular radius in a sphere, degrees.
            half_vectors: (T, 3), NaN where the frame was rejected.
            weights: (T,), by which places count instead of frames.
        """
        radii = np.radians(light_radius) * np.array(DISC_SHARES)
        middle = float(radii[1])
        around = frames_between(
            half_vectors, random_order(weights), 0.0, float(np.degrees(FRAMES_REACH * middle)), AROUND_FRAMES
        )
        reach = float(middle * (FRAMES_REACH + 2.0 * GRID_REACH))
        distances = np.sqrt((np.arange(TABLE_LENGTH) + 0.5) / TABLE_LENGTH)[:, None] * reach
        inside = 1.0 / (1.0 + np.exp((distances / radii - 1.0) / EDGE_SHARE))
        lit = LIT_OUTSIDE + (1.0 - LIT_OUTSIDE - DARK_INSIDE) * inside
        step = float(2.0 * GRID_REACH * middle / (GRID - 1))
        return cls(around, np.log(lit).astype(np.float32), np.log(1.0 - lit).astype(np.float32), reach, step)


@njit(cache=True, nogil=True)
def disc_centres(lit: LitFrames, half_vectors: np.ndarray, normals: np.ndarray, model: DiscModel) -> np.ndarray:
    """Return the centres (K, N, 3) float32 of the candidates' discs, NaN where there is no candidate.

    Args:
        lit: lit frames of N pixels.
        half_vectors: (T, 3) float32, NaN where the frame was rejected.
        normals: (K, N, 3) float32, means of the candidates' lit frames.
        model: of the same half vectors.
    """
    candidates, pixels = normals.shape[:2]
    centres = normals.copy()
    is_lit = np.zeros(len(half_vectors), np.bool_)
    scores = np.empty((GRID, GRID, len(DISC_SHARES)), np.float32)
    for pixel in range(pixels):
        own = lit.frames[lit.starts[pixel] : lit.starts[pixel + 1]]
        for frame in own:
            is_lit[frame] = True
        for k in range(candidates):
            if np.isnan(normals[k, pixel, 0]):
                break
            frames = model.around[_nearest(normals[k, pixel], own, half_vectors)]
            _score_centres(scores, normals[:, pixel], k, frames, is_lit, half_vectors, model)
            _move_to_mean(centres[k, pixel], scores, model.step)
        for frame in own:
            is_lit[frame] = False
    return centres


@njit(cache=True, nogil=True)
def _nearest(normal: np.ndarray, frames: np.ndarray, half_vectors: np.ndarray) -> int:
    """Return the frame of `frames` whose half vector is nearest to a normal (3,)."""
    nearest, largest = frames[0], np.float32(-2.0)
    for frame in frames:
        cosine = _cosine(half_vectors[frame], normal)
        if cosine > largest:
            nearest, largest = frame, cosine
    return nearest


@njit(cache=True, nogil=True)
def _cosine(a: np.ndarray, b: np.ndarray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def _tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (3,) perpendicular to a normal (3,) with n_z > -1 and to one another (Frisvad 2012)."""
    x, y, share = normal[0], normal[1], np.float32(1.0) / (np.float32(1.0) + normal[2])
    across = np.array([np.float32(1.0) - x * x * share, -x * y * share, -x])
    return across, np.array([-x * y * share, np.float32(1.0) - y * y * share, -y])


@njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract", "reassoc"})
def _score_centres(
    scores: np.ndarray,
    normals: np.ndarray,
    k: int,
    frames: np.ndarray,
    is_lit: np.ndarray,
    half_vectors: np.ndarray,
    model: DiscModel,
) -> None:
    """Write the log-likelihoods (GRID, GRID, R) of centres about candidate k of a pixel, and of radii, to `scores`.

    normals: (K, 3), the pixel's candidates. frames: to look at, -1 where there are fewer. is_lit: (T,) bool.
    """
    across, upward = _tangents(normals[k])
    step, scale = np.float32(model.step), np.float32(TABLE_LENGTH / model.reach**2)
    scores[:] = 0.0
    for frame in frames:
        if frame < 0:
            break
        h = half_vectors[frame]
        table = model.dark
        if is_lit[frame]:
            # What lights the pixel by another candidate's path tells nothing about this one.
            cosine, is_other = _cosine(h, normals[k]), False
            for other in range(len(normals)):
                is_other |= other != k and _cosine(h, normals[other]) > cosine
            if is_other:
                continue
            table = model.lit
        x, y = _cosine(h, across), _cosine(h, upward)
        for row in range(GRID):
            dy = y - (row - GRID // 2) * step
            for column in range(GRID):
                dx = x - (column - GRID // 2) * step
                place = min(int((dx * dx + dy * dy) * scale), TABLE_LENGTH - 1)
                for radius in range(len(DISC_SHARES)):
                    scores[row, column, radius] += table[place, radius]


@njit(cache=True, nogil=True)
def _move_to_mean(centre: np.ndarray, scores: np.ndarray, step: float) -> None:
    """Move a unit vector (3,) to the mean of the centres about it, by their log-likelihoods (GRID, GRID, R)."""
    highest = scores.max()
    total = x = y = 0.0
    for row in range(GRID):
        for column in range(GRID):
            for score in scores[row, column]:
                likelihood = np.exp(score - highest)
                total += likelihood
                x += likelihood * (column - GRID // 2)
                y += likelihood * (row - GRID // 2)
    across, upward = _tangents(centre)
    moved = centre + np.float32(x / total * step) * across + np.float32(y / total * step) * upward
    centre[:] = moved / np.sqrt((moved**2).sum())
