"""Right prisms with rounded edges: a smaller prism grown by a ball.

Each point of such a solid is as far from the smaller prism, its core, as the ball is large, and its normal leads away
from the nearest point of the core. So a view ray meets it where its distance from the core has fallen to the ball's
radius, which sphere tracing finds (J. C. Hart, Sphere Tracing, The Visual Computer 1996).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.perspective import to_camera_directions
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.prisms.right_prism import RightPrism, SweptContour
from glint.tasks.algorithms.prisms.rounded_contour import from_polygon, inset_polygon

TRACING_STEPS = 12
"""Steps along a view ray, from the planes that touch the solid: next to its contour they are short."""
MISSED_PX = 1.0
"""Distance in pixels from the surface at which a ray that the steps have not led there still shows it."""
MAX_FLAT_DEG = 1.0
"""Angle to the normal of a face up to which a pixel shows its flat part."""


class RoundedSurface(NamedTuple):
    """Surface of a rounded prism where view rays meet it.

    normals: (N, 3), camera frame, NaN beside the solid. edges: (N, 3), unit directions of the edges there, 0 on faces
    and at corners. depths: (N,), z in pixels, those of `RightPrism.depths`, up to a constant for all.
    """

    normals: np.ndarray
    edges: np.ndarray
    depths: np.ndarray


@dataclass(frozen=True, eq=False)
class RoundedPrism:
    """Right prism with rounded edges.

    core: prism that a ball grows. radius: of the ball, pixels.
    """

    core: RightPrism
    radius: float

    def seen_from(self, middle: np.ndarray, stride: int) -> "RoundedPrism":
        """Return the solid in an image of every `stride`-th pixel, whose centre lies at `middle` (2,) in this one."""
        return RoundedPrism(self.core.seen_from(middle, stride), self.radius / stride)

    def with_slope(self, slope: float) -> "RoundedPrism":
        """Return the solid with the same contour whose axis has another slope in radians."""
        return replace(self, core=replace(self.core, slope=slope))

    def with_radius(self, radius: float) -> "RoundedPrism | None":
        """Return the solid with the same straight parts of the contour and edges of another radius; None: too large."""
        visible, hidden = self.core.contour.visible, self.core.contour.hidden
        corners = inset_polygon(np.concatenate([visible, hidden]), radius - self.radius)
        if corners is None:
            return None
        contour = SweptContour(corners[: len(visible)], corners[len(visible) :])
        return RoundedPrism(replace(self.core, contour=contour), radius)

    def surface(self, x: np.ndarray, y: np.ndarray) -> RoundedSurface:
        """Return what view rays at image positions x, y (N,) meet."""
        points, rays = self._touched(x, y)
        frame, origin = self._frame, self._origin
        local, along = np.ascontiguousarray((points - origin) @ frame.T), np.ascontiguousarray(-unit(rays) @ frame.T)
        normals, edges, distances = _traced(local, along, self._section, self._half_height, self.radius, TRACING_STEPS)
        missed = (np.abs(distances - self.radius) > MISSED_PX) | ((normals * along).sum(axis=1) >= 0.0)
        normals[missed], local[missed] = np.nan, np.nan
        return RoundedSurface(normals @ frame, edges @ frame, (local @ frame + origin)[:, 2])

    def flat_faces(self, normals: np.ndarray) -> np.ndarray:
        """Return the number (N,) of the visible face to whose flat part normals (N, 3) belong, -1 for edges.

        normals: camera frame, of `surface`.
        """
        cosines = np.nan_to_num(normals @ self.core.normals.T, nan=-1.0)
        return np.where(cosines.max(axis=1) > np.cos(np.radians(MAX_FLAT_DEG)), cosines.argmax(axis=1), -1)

    def _touched(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where view rays at x, y (N,) meet the first of the faces' planes, (N, 3), and the rays (N, 3)."""
        core, rays = self.core, to_camera_directions(x, y, self.core.inverse_focal)
        starts = np.column_stack([x, y, np.zeros(len(x))])
        heights = np.full(len(x), np.inf)
        for anchor, normal in zip(core.anchors, core.normals, strict=True):
            slope = rays @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                height = ((anchor + self.radius * normal - starts) @ normal) / slope
            heights = np.where(slope > 0.0, np.fmin(heights, height), heights)
        return starts + heights[:, None] * rays, rays

    @cached_property
    def _frame(self) -> np.ndarray:
        """Rotation (3, 3) from the camera frame to one whose third axis is that of the prism."""
        axis = self.core.axis
        across = unit(np.cross(axis, [0.0, 0.0, 1.0]))
        return np.stack([across, np.cross(axis, across), axis])

    @cached_property
    def _origin(self) -> np.ndarray:
        """Point (3,) half-way between the ends."""
        return np.asarray(self.core.anchors[0] - self._half_height * self.core.axis)

    @cached_property
    def _half_height(self) -> float:
        """Half the distance between the ends of the core, pixels."""
        return self.core.height / 2.0

    @cached_property
    def _section(self) -> np.ndarray:
        """Corners (N, 2) of the core's section across its axis, counter-clockwise about it."""
        section = ((self.core.visible_end - self._origin) @ self._frame.T)[:, :2]
        area = section[:, 0] @ np.roll(section[:, 1], -1) - section[:, 1] @ np.roll(section[:, 0], -1)
        return np.ascontiguousarray(section if area > 0.0 else section[::-1])


@njit(cache=True)
def _traced(
    points: np.ndarray, along: np.ndarray, section: np.ndarray, half_height: float, radius: float, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move points (N, 3) along unit directions (N, 3) to the surface, in the prism's frame.

    section: corners (M, 2) of the core's section, counter-clockwise. Returns unit normals (N, 3), directions (N, 3) of
    the edges, 0 on faces and at corners, and distances (N,) from the core, the radius where the surface was met.
    """
    normals, edges, distances = np.zeros_like(points), np.zeros_like(points), np.zeros(len(points))
    for number in range(len(points)):
        point = points[number]
        x, y, z, side, distance = 0.0, 0.0, 0.0, -1, 0.0
        for step in range(steps + 1):
            x, y, side = from_polygon(point[0], point[1], section)
            z = max(abs(point[2]) - half_height, 0.0) * (1.0 if point[2] > 0.0 else -1.0)
            distance = np.sqrt(x * x + y * y + z * z)
            if step == steps or abs(distance - radius) < 1e-3:
                break
            point += (distance - radius) * along[number]
        distances[number] = distance
        if distance > 0.0:
            normals[number, 0], normals[number, 1], normals[number, 2] = x / distance, y / distance, z / distance
        if z == 0.0 and side < 0:
            edges[number, 2] = 1.0
        elif z != 0.0 and side >= 0:
            # Perpendicular to the way from the nearest point, in the plane of an end.
            length = np.sqrt(x * x + y * y)
            if length > 0.0:
                edges[number, 0], edges[number, 1] = -y / length, x / length
    return normals, edges, distances
