"""Half vectors that chrome spheres show under lights at known positions, by the mirror law alone."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere

LEFT, RIGHT = Sphere(40.0, 120.0, 30.0), Sphere(440.0, 160.0, 30.0)
MIDDLE = (240.0, 140.0)
"""Between the two."""


def spiral(count: int, widest: float = 70.0) -> np.ndarray:
    """Return light directions (N, 3) that wind outwards from the view axis."""
    share = np.sqrt((np.arange(count) + 0.5) / count)
    polar, azimuth = np.radians(widest) * share, 2 * np.pi * 9 * share
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def light_positions(distance: float | np.ndarray, count: int = 400) -> np.ndarray:
    """Return positions (N, 3) of a light at distances (N,) from the middle, frame pixels, y up."""
    return np.array([MIDDLE[0], -MIDDLE[1], 0.0]) + np.reshape(distance, (-1, 1)) * spiral(count)


def half_vectors_at(positions: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the half vectors (N, 3) of lights at `positions`, at the pixel (x, y) of the frame."""
    return half_vectors_of(unit(positions - (x, -y, 0.0)))


def sphere_normals(positions: np.ndarray, sphere: Sphere) -> np.ndarray:
    """Return the normals (N, 3) of a sphere where it reflects lights at `positions`."""
    normal = half_vectors_at(positions, sphere.x, sphere.y)
    for _ in range(8):
        normal = half_vectors_of(unit(positions - (sphere.x, -sphere.y, 0.0) - sphere.radius * normal))
    return normal


def sphere_normals_in_perspective(
    positions: np.ndarray, sphere: Sphere, centre: tuple[float, float], focal: float
) -> np.ndarray:
    """Return what an orthographic reading takes for the normals (N, 3) of a sphere that a near camera sees.

    The camera looks along the sphere's own view vector, which becomes the z axis; its normals turn with it.
    """
    view = unit(np.array([-(sphere.x - centre[0]) / focal, (sphere.y - centre[1]) / focal, 1.0]))
    normal = unit(unit(positions - (sphere.x, -sphere.y, 0.0)) + view)
    for _ in range(8):
        normal = unit(unit(positions - (sphere.x, -sphere.y, 0.0) - sphere.radius * normal) + view)
    axis = np.cross(view, (0.0, 0.0, 1.0))
    sine, cosine = np.linalg.norm(axis), view[2]
    axis = axis / max(float(sine), 1e-12)
    along = (normal @ axis)[:, None] * axis
    return along + cosine * (normal - along) + sine * np.cross(axis, normal)


def shifted(normals: np.ndarray, x: float, y: float = 0.0) -> np.ndarray:
    """Return what a sphere's normals (N, 3) are read as with its centre wrong by (x, y) radii."""
    plane = normals[:, :2] + (x, y)
    return np.concatenate([plane, np.sqrt(1.0 - (plane**2).sum(axis=1, keepdims=True))], axis=1)
