"""Clusters of candidate normals from each pixel's highlights ("normal clustering", section 4.2 of Yeung et al. 2009).

A pixel shows a highlight in those frames whose half vector is a normal of one of its light paths. The light is not a
point, so each direct path lights a small disc of half vectors; false paths light discs too, or arcs. The paper uses
k-means, with K by minimum description length. Here the size of the disc is known, and each cluster is the densest disc
of the highlights that the clusters before it left, centred by mean shift (Cheng 1995) where it is brightest: an arc
beside a disc cannot pull its centre, and a disc that only one frame shows is kept. Then the frames that leave the pixel
dark tell how far the disc reaches to all sides, and so where its centre is (`disc_centres`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from glint.tasks.algorithms.candidates.densest_discs import densest_discs
from glint.tasks.algorithms.candidates.disc_centres import DiscModel, disc_centres
from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels, collect_lit_frames
from glint.tasks.algorithms.candidates.surround import Rings, candidate_shading, find_rings

USUAL_DISC_DEG = 2.2
"""Radius of the disc of half vectors of a usual light: half of what it lights."""


@dataclass(frozen=True, slots=True)
class Clusters:
    """Candidate normals of each pixel in the order in which they are found: each the densest disc of what is left.

    normals: (K, H, W, 3) float32, unit, camera frame, NaN where there is no such cluster. weight: (K, H, W) float32,
    sum of its frames' weights, under sparse lights times their brightness. spread: (K, H, W) float32, RMS angle in
    radians to the normal, NaN likewise. count: (K, H, W) int32, frames. observations: (H, W) int32, the paper's M:
    frames in which the pixel is lit. winner: (H, W, 3) float32, top eigenvector of sum h h^T over all of them (Chen et
    al. 2006). shading: (K, H, W) float32, level beside the candidate's disc between dark (0) and lit (1), NaN where
    unknown.
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
    radius_deg: float = USUAL_DISC_DEG,
    separation: float = 1.6,
    rings: Rings | None = None,
    discs: DiscModel | None = None,
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
        discs: of these half vectors; None: a cluster's normal is the mean of its lit frames.
    """
    height, width = frames.shape[1:]
    usable = np.flatnonzero(np.isfinite(half_vectors[:, 0]))
    levels, radius = frames.reshape(len(frames), -1), float(np.radians(radius_deg))
    flat = highlights._replace(thresholds=highlights.thresholds.reshape(-1))
    lit = collect_lit_frames(levels, usable, flat)
    normals, weight, spread, count, winner = densest_discs(lit, half_vectors, weights, clusters, radius, separation)
    rings = rings or find_rings(half_vectors, weights)
    shading = candidate_shading(levels, lit, half_vectors, normals, float(np.cos(radius)), rings)
    if discs is not None:
        normals = disc_centres(lit, half_vectors, normals, discs)
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
