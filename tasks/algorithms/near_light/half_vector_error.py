"""Systematic errors that the half vectors of all frames share at a pixel, as standard deviations per axis.

A direction to the light, or a view vector, that is wrong by an angle turns the half vector by half of it. These errors
look like another surface (a near light adds a paraboloid to first order), so no residual shows them: they are stated by
what is not known. Independent parts are combined in quadrature.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere, precision_weights

LEAST_DISTANCE_SIZES = 10.0
"""Least distance of a light in sizes of the object, as the guide to photographing recommends it."""
MEAN_FORESHORTENING = 0.85
"""Mean sine of the angle between an offset in the image and a light of a whole sweep, by which its parallax shrinks."""
DEPTH_SIZES = 0.25
"""Standard deviation of a surface point's height above the spheres' centres, in sizes of the object."""
USUAL_NZ = 0.85
"""Mean n_z of the half vectors of a whole sweep."""
MEAN_OBLIQUITY = 0.6
"""Mean sine of the angle between view and light over a whole sweep, which turns heights into parallax."""


@dataclass(frozen=True, slots=True)
class PixelGrid:
    """Pixels of a region: columns and rows (H, W) of the full frame, y down; size: the longer side, in pixels."""

    columns: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, left: int, top: int, width: int, height: int) -> "PixelGrid":
        """Return the pixels of a region of the frame."""
        rows, columns = np.mgrid[top : top + height, left : left + width]
        return cls(columns, rows)

    @property
    def size(self) -> float:
        """Longer side in pixels."""
        return float(max(self.columns.shape))


def combined_error(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return the standard deviation per axis (H, W) float32, radians, of the sum of independent errors, each (H, W)."""
    return np.asarray(np.sqrt(sum(np.square(part, dtype=np.float64) for part in parts)), np.float32)


def spheres_error(spheres: Sequence[Sphere], nz: np.ndarray) -> np.ndarray:
    """Return the error (...), radians per axis, that the spheres' fits leave in their mean half vectors.

    nz: (...) z components of these. Without spheres it is 0.
    """
    if not spheres:
        return np.zeros(np.shape(nz))
    weights = precision_weights(spheres, np.stack([nz] * len(spheres)))
    deviations = np.stack([sphere.half_vector_sd(nz) for sphere in spheres])
    return np.asarray(np.sqrt(((weights * deviations) ** 2).sum(axis=0)))


def unknown_distance_error(pixels: PixelGrid, spheres: Sequence[Sphere]) -> np.ndarray:
    """Return the error (H, W), radians per axis, of a light whose distance from a single sphere is not known."""
    return light_distance_error(pixels, spheres, unknown_inverse_distance(pixels))


def unknown_inverse_distance(pixels: PixelGrid) -> float:
    """Return the standard deviation of the inverse distance, 1/pixels, of a light of which nothing shows the distance.

    It is that of the least distance that is recommended, in full along both axes, since the light's direction varies.
    """
    return float(np.sqrt(2.0) / (LEAST_DISTANCE_SIZES * pixels.size))


def light_distance_error(pixels: PixelGrid, spheres: Sequence[Sphere], inverse_distance_sd: float) -> np.ndarray:
    """Return the error (H, W), radians per axis, by the standard deviation of a light's inverse distance in 1/pixels.

    spheres: in pixels of the full frame; at their mean position the direction to the light is right at any distance.
    """
    x, y = mean_position(spheres)
    parallax = MEAN_FORESHORTENING * inverse_distance_sd * np.hypot(pixels.columns - x, pixels.rows - y)
    return _per_axis(parallax)


def mean_position(spheres: Sequence[Sphere]) -> tuple[float, float]:
    """Return x and y of spheres' mean position, weighted by their precision."""
    weights = precision_weights(spheres, np.full(len(spheres), USUAL_NZ))
    x, y = weights @ np.array([(sphere.x, sphere.y) for sphere in spheres])
    return float(x), float(y)


def depth_error(pixels: PixelGrid, inverse_distance: float) -> np.ndarray:
    """Return the error (H, W), radians per axis, of a near light since a pixel's height above the spheres is unknown.

    inverse_distance: of the light, 1/pixels.
    """
    parallax = MEAN_OBLIQUITY * DEPTH_SIZES * pixels.size * inverse_distance
    return _per_axis(np.full(pixels.columns.shape, parallax))


def unknown_camera_error(
    pixels: PixelGrid, spheres: Sequence[Sphere], frame_centre: tuple[float, float], focal: float
) -> np.ndarray:
    """Return the error (H, W), radians per axis, of half vectors that ignore a perspective camera.

    A sphere's normals, read as if its view vector were the optical axis, give light directions that are wrong by the
    angle between the two; the pixel's own view vector is wrong by its own angle. The two add up on one side of the axis
    and cancel on the other; how much of either remains is not known, so they are taken as independent.

    Args:
        pixels: of the object's region.
        spheres: in pixels of the full frame.
        frame_centre: x and y of the optical axis, likewise.
        focal: focal length in pixels.
    """
    of_spheres = np.mean([_view_angle(sphere.x, sphere.y, frame_centre, focal) ** 2 for sphere in spheres])
    of_pixels = _view_angle(pixels.columns, pixels.rows, frame_centre, focal)
    return _per_axis(np.sqrt(of_pixels**2 + of_spheres))


def _view_angle(
    x: np.ndarray | float, y: np.ndarray | float, frame_centre: tuple[float, float], focal: float
) -> np.ndarray:
    """Return the angle (...), radians, between the view vector of a pixel (...) and the optical axis."""
    return np.asarray(np.arctan(np.hypot(x - frame_centre[0], y - frame_centre[1]) / focal))


def _per_axis(direction_error: np.ndarray) -> np.ndarray:
    """Return the half vector's error per axis by the size of a direction's error (H, W), both in radians."""
    return 0.5 * direction_error / np.sqrt(2.0)
