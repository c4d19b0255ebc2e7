"""Near point light: its distance from the parallax between two chrome spheres, and half vectors corrected for it.

Yeung et al. 2009 assume a distant light (section 3). A near one is seen in different directions from sphere and
object. Two spheres measure its distance by triangulation (Powell et al. 2001), and with
it the half vector that a sphere gave is converted to that of each pixel.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere

MIN_SHARED_FRAMES = 20
"""Frames that two spheres must share."""
MIN_SIGNIFICANCE = 5.0
"""Standard errors by which the inverse distance must exceed zero."""
MIN_PARALLAX_DEG = 0.3
"""Difference between the spheres' directions to the light below which it counts as distant."""
MIN_TANGENT_NZ = 0.2
"""Lower bound of n_z in the derivative of a normal by its n_x and n_y."""
ROBUST_ITERATIONS = 3
"""Fits of the inverse distance, each without the outliers of the one before."""


@dataclass(frozen=True, slots=True)
class PointLight:
    """Point light at a distance in pixels from a sphere.

    x, y, radius: the sphere's, in pixels of the full frame, y down; of several spheres the mean.
    """

    distance: float
    x: float
    y: float
    radius: float

    @classmethod
    def from_distance(cls, spheres: Sequence[Sphere], distance: float) -> "PointLight":
        """Return the light at a known distance in pixels from the spheres."""
        mean = np.mean([(sphere.x, sphere.y, sphere.radius) for sphere in spheres], axis=0)
        return cls(distance, *(float(value) for value in mean))

    def half_vectors_at(self, half_vectors: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the half vectors (..., 3) float32 at pixels of the frame, from those (..., 3) of the sphere.

        columns, rows: (...), pixels of the full frame. The light's position is the sphere's surface point that
        reflects it, plus the distance along the sphere's light direction.
        """
        directions = lights_of(half_vectors.astype(np.float64))
        offset = np.stack([columns - self.x, self.y - rows, np.zeros(np.shape(columns))], axis=-1)
        position = self.radius * half_vectors + self.distance * directions - offset
        return np.asarray(half_vectors_of(unit(position)), np.float32)


def estimate_point_light(half_vectors: Sequence[np.ndarray], spheres: Sequence[Sphere]) -> PointLight | None:
    """Estimate the light's usual distance; None if it is distant, or if no two spheres share enough frames.

    Pairs of spheres are combined with weights of their inverse variance.

    Args:
        half_vectors: (T, 3) of each sphere, NaN where the frame was rejected.
        spheres: in pixels of the full frame.
    """
    weighted_sum = precision = 0.0
    for first in range(len(spheres)):
        for second in range(first + 1, len(spheres)):
            estimate = _inverse_distance(half_vectors[first], half_vectors[second], spheres[first], spheres[second])
            if estimate is not None:
                weighted_sum, precision = weighted_sum + estimate[0] / estimate[1], precision + 1.0 / estimate[1]
    if precision == 0.0:
        return None
    inverse_distance, error = weighted_sum / precision, precision**-0.5
    span = max(np.hypot(a.x - b.x, a.y - b.y) for a in spheres for b in spheres)
    if inverse_distance < MIN_SIGNIFICANCE * error or np.degrees(inverse_distance * span) < MIN_PARALLAX_DEG:
        return None
    return PointLight.from_distance(spheres, 1.0 / inverse_distance)


def _inverse_distance(
    first: np.ndarray, second: np.ndarray, first_sphere: Sphere, second_sphere: Sphere
) -> tuple[float, float] | None:
    """Return the light's inverse distance (1 / pixels) and its variance, from the half vectors (T, 3) of two spheres.

    To first order the direction to the light at a position p is l - (p - (p.l) l) / distance, so the difference
    between two spheres' directions is linear in the inverse distance. An error of a sphere's centre rotates all its
    normals alike; two further unknowns, along x and y, take it up.
    """
    shared = np.isfinite(first[:, 0]) & np.isfinite(second[:, 0])
    if shared.sum() < MIN_SHARED_FRAMES:
        return None
    a, b = first[shared].astype(float), second[shared].astype(float)
    light = unit(lights_of(a) + lights_of(b))
    # Baseline between the reflecting surface points, perpendicular to the light.
    offset = np.array([first_sphere.x - second_sphere.x, second_sphere.y - first_sphere.y, 0.0])
    baseline = offset + first_sphere.radius * a - second_sphere.radius * b
    parallax = -(baseline - (baseline * light).sum(axis=1, keepdims=True) * light)
    columns = [parallax, *_centre_error_columns(unit(a + b))]
    matrix = np.stack([column.ravel() for column in columns], axis=1)
    difference = (lights_of(a) - lights_of(b)).ravel()
    # Least squares, repeated without residuals beyond three robust standard deviations.
    inliers = np.ones(len(difference), bool)
    solution, error = np.zeros(3), 0.0
    for _ in range(ROBUST_ITERATIONS):
        solution = np.linalg.lstsq(matrix[inliers], difference[inliers], rcond=None)[0]
        residuals = difference - matrix @ solution
        error = 1.4826 * float(np.median(np.abs(residuals[inliers]))) + 1e-9
        inliers = np.abs(residuals) < 3.0 * error
    covariance = np.linalg.inv(matrix[inliers].T @ matrix[inliers]) * error**2
    return float(solution[0]), float(covariance[0, 0]) + 1e-14


def _centre_error_columns(normal: np.ndarray) -> list[np.ndarray]:
    """Return the derivatives (T, 3) of light directions by an error of the normals' (T, 3) n_x and of their n_y."""
    columns = []
    for axis in (0, 1):
        tangent = np.zeros_like(normal)
        tangent[:, axis] = 1.0
        tangent[:, 2] = -normal[:, axis] / np.maximum(normal[:, 2], MIN_TANGENT_NZ)
        columns.append(2.0 * (normal[:, 2:] * tangent + tangent[:, 2:] * normal))
    return columns
