"""Near light: its position in every frame, and half vectors of the object's pixels corrected for it.

Yeung et al. 2009 assume a distant light (Figure 2, section 5). A near one is seen in different directions from sphere
and object. Its position relative to a reference point (the middle of the object's region) is kept as a direction and an
inverse distance, which is zero for a distant light. Both are in pixels of the object: the object and the spheres are
taken to be equally far from the camera.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from glint.tasks.algorithms.geometry.perspective import Cone
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere

NEIGHBOURING_LIGHTS = 6
"""Frames whose distances are averaged where a half vector lies between those of frames."""


@dataclass(frozen=True, slots=True)
class NearLight:
    """Positions of a near light in T frames.

    x, y: the reference point, pixels of the full frame, y down. half_vectors (T, 3): at the reference point, NaN where
    the frame was rejected. inverse_distance (T,): of the light from the reference point, 1/pixels.
    """

    x: float
    y: float
    half_vectors: np.ndarray
    inverse_distance: np.ndarray

    def half_vectors_at(self, half_vectors: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the half vectors (..., 3) float32 at pixels of the frame, from those (..., 3) at the reference point.

        columns, rows: (...), pixels of the full frame. A half vector that lies between those of frames, such as a
        cluster's centre, has the mean distance of the nearest frames.
        """
        result = np.full(half_vectors.shape, np.nan, np.float32)
        finite, known = np.isfinite(half_vectors[..., 0]), np.isfinite(self.half_vectors[:, 0])
        if not (finite.any() and known.any()):
            return result
        count = min(NEIGHBOURING_LIGHTS, int(known.sum()))
        _, nearest = cKDTree(self.half_vectors[known]).query(half_vectors[finite], count)
        inverse = self.inverse_distance[known][nearest.reshape(-1, count)].mean(axis=1)
        shape = half_vectors.shape[:-1]
        offset = np.stack(
            [
                np.broadcast_to(columns, shape)[finite] - self.x,
                self.y - np.broadcast_to(rows, shape)[finite],
                np.zeros(int(finite.sum())),
            ],
            axis=-1,
        )
        directions = lights_of(half_vectors[finite].astype(np.float64))
        result[finite] = half_vectors_of(unit(directions - inverse[:, None] * offset))
        return result


@dataclass(frozen=True, slots=True)
class SphereLights:
    """Light directions that one sphere shows: the sphere as a site from which the light is seen.

    lights (T, 3) float64: NaN where the sphere shows none. positions (T, 3): the surface point that reflects the light,
    relative to the reference point, in pixels, y up.
    """

    lights: np.ndarray
    positions: np.ndarray

    @classmethod
    def of(
        cls, half_vectors: np.ndarray, sphere: Sphere, reference: tuple[float, float], camera: np.ndarray | None
    ) -> "SphereLights":
        """Return the lights of a sphere.

        Args:
            half_vectors: (T, 3) that the sphere shows, relative to V0 = (0, 0, 1).
            sphere: in pixels of the full frame.
            reference: x and y of the reference point, likewise.
            camera: matrix (3, 3) of a perspective camera, under which the sphere's normal is midway between the light
                and the view vector of the sphere.
        """
        lights = lights_of(half_vectors.astype(np.float64))
        view = np.array([0.0, 0.0, 1.0])
        if camera is not None:
            view = -Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera).axis
        centre = np.array([sphere.x - reference[0], reference[1] - sphere.y, 0.0])
        return cls(lights, centre + sphere.radius * unit(lights + view))

    def at_reference(self, inverse_distance: np.ndarray) -> np.ndarray:
        """Return the light's directions (T, 3) at the reference point, given its inverse distance (T,) from there.

        With the reference point at 0 and the sphere's surface point at q, a light at P in direction l from q is at
        P = q + s l with |P| = d, hence s = sqrt(d^2 - |q|^2 + (q.l)^2) - q.l.
        """
        inverse = inverse_distance[:, None]
        scaled = inverse * self.positions
        along = (scaled * self.lights).sum(axis=1, keepdims=True)
        square = 1.0 - (scaled**2).sum(axis=1, keepdims=True) + along**2
        return unit(scaled + (np.sqrt(np.maximum(square, 1e-6)) - along) * self.lights)


def median_distance(inverse_distance: np.ndarray) -> float:
    """Return the distance in pixels at the median of a light's inverse distances (T,), 1/pixels, NaN left out."""
    return float(1.0 / np.nanmedian(inverse_distance))
