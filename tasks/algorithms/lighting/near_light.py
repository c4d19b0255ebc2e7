"""A lamp that is near: ball and object see it from different places (METHOD asks for a distant one).

From two balls the lamp's distance follows: the nearer it is, the more do the directions differ in which they see it.
With that distance the half vector that a ball gave for a pixel's highlight is corrected to the pixel's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere

LEAST_FRAMES = 20
SURE = 5.0
"""Standard errors by which the nearness must exceed zero to be believed."""
LEAST_DEGREES = 0.3
"""Difference between the balls' directions to the lamp below which it counts as far away."""


@dataclass(frozen=True, slots=True)
class NearLamp:
    """A lamp `distance` pixels from the ball at (x, y) in the frame's pixels, of that radius (several: their mean)."""

    distance: float
    x: float
    y: float
    radius: float

    def seen_from(self, half_vectors: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Half vectors (..., 3) of the ball as pixels of the frame (columns and rows, (...)) have them."""
        directions = lights_of(half_vectors.astype(np.float64))
        away = np.stack([columns - self.x, self.y - rows, np.zeros(np.shape(columns))], axis=-1)
        lamp = self.radius * half_vectors + self.distance * directions - away
        return np.asarray(half_vectors_of(unit(lamp)), np.float32)


def lamp_beside(spheres: Sequence[Sphere], distance: float) -> NearLamp:
    """A lamp of known distance in pixels."""
    mean = np.mean([(each.x, each.y, each.radius) for each in spheres], axis=0)
    return NearLamp(distance, *(float(value) for value in mean))


def find_near_lamp(half_vectors: Sequence[np.ndarray], spheres: Sequence[Sphere]) -> NearLamp | None:
    """The lamp's usual distance from the half vectors (T, 3; NaN where rejected) of each of several balls.

    None where it is too far to tell, or there are too few frames that two balls share. An error of a ball's centre
    turns all of its normals alike; it is estimated with the distance.
    """
    near = variance = 0.0
    for first in range(len(spheres)):
        for second in range(first + 1, len(spheres)):
            found = _nearness(half_vectors[first], half_vectors[second], spheres[first], spheres[second])
            if found is not None:
                near, variance = near + found[0] / found[1], variance + 1.0 / found[1]
    if variance == 0.0:
        return None
    near, error = near / variance, variance**-0.5
    span = max(np.hypot(a.x - b.x, a.y - b.y) for a in spheres for b in spheres)
    if near < SURE * error or np.degrees(near * span) < LEAST_DEGREES:
        return None
    return lamp_beside(spheres, 1.0 / near)


def _nearness(first: np.ndarray, second: np.ndarray, one: Sphere, other: Sphere) -> tuple[float, float] | None:
    """One over the lamp's distance in pixels, and the square of its standard error, from two balls.

    To first order a place p sees the lamp in the direction l - (p - (p.l) l) / distance.
    """
    both = np.isfinite(first[:, 0]) & np.isfinite(second[:, 0])
    if both.sum() < LEAST_FRAMES:
        return None
    a, b = first[both].astype(float), second[both].astype(float)
    light = unit(lights_of(a) + lights_of(b))
    apart = np.array([one.x - other.x, other.y - one.y, 0.0]) + one.radius * a - other.radius * b
    across = -(apart - (apart * light).sum(axis=1, keepdims=True) * light)
    normal = unit(a + b)
    columns = [across]
    for axis in (0, 1):
        turn = np.zeros_like(normal)
        turn[:, axis] = 1.0
        turn[:, 2] = -normal[:, axis] / np.maximum(normal[:, 2], 0.2)
        columns.append(2.0 * (normal[:, 2:] * turn + turn[:, 2:] * normal))
    matrix = np.stack([column.ravel() for column in columns], axis=1)
    told = (lights_of(a) - lights_of(b)).ravel()
    kept = np.ones(len(told), bool)
    solution, error = np.zeros(3), 0.0
    for _ in range(3):
        solution = np.linalg.lstsq(matrix[kept], told[kept], rcond=None)[0]
        off = told - matrix @ solution
        error = 1.4826 * float(np.median(np.abs(off[kept]))) + 1e-9
        kept = np.abs(off) < 3.0 * error
    covariance = np.linalg.inv(matrix[kept].T @ matrix[kept]) * error**2
    return float(solution[0]), float(covariance[0, 0]) + 1e-14
