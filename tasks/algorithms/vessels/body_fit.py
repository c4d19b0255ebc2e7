"""How well a body explains the candidates of an object: how far they scatter about its normals, and how far it is off.

Candidates of an exact body of revolution scatter about its normals by their own noise. Hand-made glass deviates from
any such body, but smoothly: the mean of neighbouring candidates keeps that deviation and loses the noise.
"""

from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.blur import gaussian_blur
from glint.tasks.algorithms.geometry.vectors import angles, lengths
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals

NEAR_DEG = 8.0
"""Angle from the body's normal up to which a candidate may be one of its surface."""
LEAST_SCATTER_DEG, LARGEST_SCATTER_DEG = 1.0, 4.0
"""Bounds of the scatter: that of noise alone, and that of angles that are arbitrary up to NEAR_DEG."""
MEDIAN_OF_RAYLEIGH = 1.18
"""Median of the angle between two directions, for a standard deviation of 1 per axis."""
NEIGHBOUR_INRADII = 0.08
"""Standard deviation of the window over which candidates are averaged, in inradii of the object."""
NEIGHBOURHOOD_DEG = 0.5
"""Error of the mean of neighbouring candidates, which a body with a smaller deviation outweighs."""
USUAL_FIELD_DEG, MAX_PRECISION = 1.0, 16.0
"""Deviation of a body from which it predicts no more than a usual expected field between accepted normals, and the
largest factor by which it predicts more."""
MAX_TRUST = 5.0
"""Largest weight of the body relative to an accepted normal."""
RIVALRIES, WALL_SHARES = (0.2, 0.5, 0.8, 1.0, 1.5), (1.0, 0.97, 0.93, 0.82, 0.7)
"""Rivalry of a circle, and the share of its confident normals that is right, relative to circles without a rival: on 43
simulated captures."""


class BodyFit(NamedTuple):
    """Fit of a body's normals to candidates.

    scatter_deg: standard deviation per axis of the nearest candidates. deviation_deg: median angle between the body's
    normals and the means of neighbouring candidates. rivalry: (H, W), and tangents: (H, W, 3), see
    `RotationalNormals`.
    """

    scatter_deg: float
    deviation_deg: float
    rivalry: np.ndarray
    tangents: np.ndarray | None = None

    @property
    def trust(self) -> float:
        """Weight of the body's normal relative to that of an accepted one."""
        return float(min((NEIGHBOURHOOD_DEG / max(self.deviation_deg, 1e-3)) ** 2, MAX_TRUST))

    @property
    def precision(self) -> float:
        """Factor of the weight of the body's normal where none was accepted, 1 if it is no better than any field."""
        return float(np.clip((USUAL_FIELD_DEG / max(self.deviation_deg, 1e-3)) ** 2, 1.0, MAX_PRECISION))

    @property
    def confidence(self) -> np.ndarray:
        """Probability (H, W) that a normal is that of the wall and not of a rival sheet, by the candidates' shares."""
        return np.asarray(np.interp(self.rivalry, RIVALRIES, WALL_SHARES))


def body_fit(body: RotationalNormals, candidates: np.ndarray, mask: np.ndarray, inradius: float) -> BodyFit:
    """Measure how well a body explains candidates.

    Args:
        body: rotationally symmetric.
        candidates: (K, H, W, 3), NaN where there are fewer.
        mask: (H, W) bool, the object.
        inradius: of the object, in pixels.
    """
    rivalry = np.zeros(mask.shape) if body.rivalry is None else body.rivalry
    nearest, difference = _nearest_candidates(candidates, body.normals)
    is_near = mask & (nearest < NEAR_DEG)
    if not is_near.any():
        return BodyFit(LARGEST_SCATTER_DEG, LARGEST_SCATTER_DEG, rivalry, body.tangents)
    difference[~is_near] = 0.0
    window = max(NEIGHBOUR_INRADII * inradius, 1.0)
    blurred = np.stack([gaussian_blur(difference[..., axis], window) for axis in range(3)], axis=-1)
    mean = blurred[is_near] / gaussian_blur(is_near, window)[is_near][:, None]
    scatter = float(np.median(nearest[is_near])) / MEDIAN_OF_RAYLEIGH
    deviation = float(np.degrees(np.median(lengths(mean))))
    return BodyFit(float(np.clip(scatter, LEAST_SCATTER_DEG, LARGEST_SCATTER_DEG)), deviation, rivalry, body.tangents)


def _nearest_candidates(candidates: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle (H, W) in degrees of the nearest of candidates (K, H, W, 3) to normals (H, W, 3).

    Also returns that candidate's difference (H, W, 3) to the normal. Without a candidate they are 180 degrees and 0.
    """
    dtype = np.result_type(candidates, normals)
    nearest, difference = np.full(normals.shape[:2], 180.0, dtype), np.zeros(normals.shape, dtype)
    # Layer by layer: all of them together would take several times the memory of the candidates.
    for layer in candidates:
        angle = angles(layer, normals)
        is_nearer = angle < nearest
        nearest[is_nearer] = angle[is_nearer]
        difference[is_nearer] = layer[is_nearer] - normals[is_nearer]
    return nearest, difference
