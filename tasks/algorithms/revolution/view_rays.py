"""View rays in the frame of an axis, and where they enter a body about it, as a surface of revolution.

The rays are parallel, or those of a perspective camera aimed at the object (`aimed_view`): then the origin of the image
is its principal point, and the camera stands where the rays meet, one focal length before the plane z = 0 in which a
pixel is as long as in the image.

The distance from the axis is not monotonic along a ray, so the first sample inside brackets the surface, and that
bracket is halved.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.perspective import to_camera_directions
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.sections.rounded_polygon import CIRCLE, RoundedPolygon, apothem_at
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

DEPTH_SAMPLES = 160
"""Samples along a ray among which the surface is bracketed."""
BISECTION_STEPS = 12
"""Halvings of that bracket."""


@dataclass(frozen=True, slots=True)
class AxisRays:
    """N view rays in the frame of an axis: across, forward and along it, in pixels.

    origins: (N, 3), where they meet the plane z = 0. directions: (N, 3), towards the camera, each with z = 1.
    """

    origins: np.ndarray
    directions: np.ndarray

    def at(self, depths: np.ndarray) -> np.ndarray:
        """Return the points (N, 3) of the rays at z (N,)."""
        return self.origins + depths[:, None] * self.directions


@dataclass(frozen=True, slots=True)
class RayHits:
    """Intersections of N view rays with a body about an axis, in pixels; NaN for rays that miss it.

    heights: (N,), along the axis. depths: (N,), z towards the camera, from the plane through the axis' image point.
    across, forward: (N,), from the axis, in its frame. apothems: (N,), of the sections through these points, the radii
    of circles. outward: (N, 3), perpendicular to the section, as long as its apothem times how much that grows outwards
    (as long as the radius of a circle), and upward: (N, 3), along the axis, unit; both relative to the ray, as the
    normals of a pixel are.
    """

    heights: np.ndarray
    depths: np.ndarray
    across: np.ndarray
    forward: np.ndarray
    apothems: np.ndarray
    outward: np.ndarray
    upward: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class AxisFrame:
    """Frame of an axis of revolution in the camera frame.

    vectors: (3, 3), unit: across the axis in the image, forward to the camera, and upward along the axis. point: (2,),
    of the axis in the image, pixels, where z and height are 0. inverse_focal: 1 over the focal length in pixels, 0 for
    parallel rays.
    """

    vectors: np.ndarray
    point: np.ndarray
    inverse_focal: float

    @classmethod
    def of(cls, axis: ReflectionAxis, tilt: float, inverse_focal: float = 0.0) -> "AxisFrame":
        """Return the frame of the axis with that image and tilt (radians) of its upper end towards the camera."""
        # The plane through the camera and the axis' image leans to the side unless the principal point lies in it.
        lean = inverse_focal * float(axis.point @ axis.normal)
        across, to_camera = unit(np.append(axis.normal, lean)), unit(np.append(-lean * axis.normal, 1.0))
        along, c, s = np.append(axis.direction, 0.0), np.cos(tilt), np.sin(tilt)
        return cls(np.stack([across, c * to_camera - s * along, c * along + s * to_camera]), axis.point, inverse_focal)

    @property
    def upward(self) -> np.ndarray:
        """Direction (3,) of the axis in the camera frame."""
        return np.asarray(self.vectors[2])

    def rays(self, x: np.ndarray, y: np.ndarray) -> AxisRays:
        """Return the view rays of image positions x, y (N,), camera frame."""
        origins = np.column_stack([x - self.point[0], y - self.point[1], np.zeros(len(x))])
        return AxisRays(origins @ self.vectors.T, to_camera_directions(x, y, self.inverse_focal) @ self.vectors.T)

    def view_vectors(self, x: np.ndarray, y: np.ndarray) -> np.ndarray | None:
        """Return the unit view vectors (N, 3) at x, y (N,), camera frame; None: all are (0, 0, 1)."""
        return None if self.inverse_focal == 0.0 else np.asarray(unit(to_camera_directions(x, y, self.inverse_focal)))

    def tilts(self, heights: np.ndarray) -> np.ndarray:
        """Return by how much the axis tilts towards the camera as seen from it at heights (N,), radians.

        It falls with the height under perspective: a camera that sees the bottom from above sees the top from below.
        """
        camera = self.vectors @ np.append(-self.inverse_focal * self.point, 1.0)
        return np.asarray(np.arctan2(camera[2] - self.inverse_focal * heights, camera[1]))


def entry_depths(
    rays: AxisRays,
    heights: np.ndarray,
    squared_radii: np.ndarray,
    reach: float,
    far: bool,
    section: RoundedPolygon = CIRCLE,
) -> np.ndarray:
    """Return z (N,) in pixels of the first point inside the body along each ray, from the far end if `far`.

    NaN for rays that miss the body.

    Args:
        rays: N of them, in the frame of the axis.
        heights: (M,), samples along the axis, equidistant.
        squared_radii: (M,) there, of the circles, or squared apothems; 0 beyond the ends.
        reach: z of the body is between this and its negative, pixels.
        far: whether to begin at the far end.
        section: of the body.
    """
    depths = np.linspace(reach, -reach, DEPTH_SAMPLES) * (-1.0 if far else 1.0)
    inner, outer = min(1.0, section.width) ** 2, section.circumradius**2
    return np.asarray(
        _entry_depths(rays.origins, rays.directions, heights, squared_radii, depths, inner, outer, section.shape)
    )


@njit(cache=True, nogil=True)
def _entry_depths(
    origins: np.ndarray,
    directions: np.ndarray,
    heights: np.ndarray,
    squared_radii: np.ndarray,
    depths: np.ndarray,
    inner: float,
    outer: float,
    shape: tuple[int, float, float, float],
) -> np.ndarray:
    """Return what `entry_depths` does.

    depths: samples of each ray. inner, outer: squared distances from the axis between which a section of apothem 1
    ends. shape: of the section.
    """
    result = np.full(len(origins), np.nan)
    widest = squared_radii.max() * outer
    for ray in range(len(origins)):
        origin = origins[ray, 0], origins[ray, 1], origins[ray, 2]
        direction = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        # No point of the ray is nearer to the axis than the widest circle about the body.
        passing = origin[0] * direction[1] - origin[1] * direction[0]
        if passing**2 >= widest * (direction[0] ** 2 + direction[1] ** 2):
            continue
        for sample in range(len(depths)):
            inside = depths[sample]
            if not _is_inside(inside, origin, direction, heights, squared_radii, inner, outer, shape):
                continue
            outside = depths[max(sample - 1, 0)]
            for _ in range(BISECTION_STEPS):
                middle = (inside + outside) / 2
                if _is_inside(middle, origin, direction, heights, squared_radii, inner, outer, shape):
                    inside = middle
                else:
                    outside = middle
            result[ray] = inside
            break
    return result


@njit(cache=True, nogil=True)
def _is_inside(
    depth: float,
    origin: tuple[float, float, float],
    direction: tuple[float, float, float],
    heights: np.ndarray,
    squared_radii: np.ndarray,
    inner: float,
    outer: float,
    shape: tuple[int, float, float, float],
) -> bool:
    """Return whether a point of a ray is nearer to the axis than the wall, whose squared radii are interpolated."""
    height, last = origin[2] + depth * direction[2], len(heights) - 1
    if not heights[0] <= height <= heights[last]:
        return False
    place = (height - heights[0]) / (heights[1] - heights[0])
    below = min(int(place), last - 1)
    square = squared_radii[below] + (place - below) * (squared_radii[below + 1] - squared_radii[below])
    across, forward = origin[0] + depth * direction[0], origin[1] + depth * direction[1]
    distance = across**2 + forward**2
    if distance >= outer * square:
        return False
    if distance < inner * square:
        return True
    sides, turn, rounding, width = shape
    return bool(square > apothem_at(across, forward, sides, turn, rounding, width)[0] ** 2)
