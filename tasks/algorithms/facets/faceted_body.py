"""Faceted bodies: every cross-section is the same regular polygon about an axis, larger or smaller.

Octagonal bottles, square decanters, cut tumblers, truncated pyramids: what a surface of revolution is with polygons in
place of its circles. The largest body inside a silhouette follows as it does there, if the size of a point's polygon,
the apothem, takes the place of its distance from the axis.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from glint.tasks.algorithms.facets.straight_profile import straight_profile
from glint.tasks.algorithms.geometry.perspective import to_camera_directions
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.prisms.right_prism import SUBPIXEL_BITS, to_pixels
from glint.tasks.algorithms.revolution.inscribed_sections import inscribed_sections
from glint.tasks.algorithms.revolution.view_rays import AxisFrame
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon

POLYGON_STEP_PX = 1.0
"""Distance along the axis of the polygons that are inscribed in a contour."""
MIN_FACING = 0.02
"""Cosine of the angle to the view vector from which a face is visible."""
MIN_CREASE_DEG = 6.0
"""Angle between two faces from which their common edge is a crease."""


class Creases(NamedTuple):
    """Straight edges between visible faces: images (C, 2) of their ends, directions (C, 3), and the faces (C, 2)."""

    starts: np.ndarray
    ends: np.ndarray
    directions: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class FacetedBody:
    """Faceted body before a camera, bounded by planes; lengths in pixels.

    polygon: its cross-section. frame: of its axis. heights, apothems: (M,), of the rings of corners between which it is
    straight, upward along the axis.
    """

    polygon: RoundedPolygon
    frame: AxisFrame
    heights: np.ndarray
    apothems: np.ndarray

    @classmethod
    def inside(cls, contour: np.ndarray, frame: AxisFrame, polygon: RoundedPolygon) -> "FacetedBody":
        """Return the largest body about an axis, with that cross-section, inside the contour of a silhouette.

        contour: (N, 2), x and y in the camera frame, pixels.
        """
        heights, apothems = inscribed_sections(frame.rays(*contour.T), POLYGON_STEP_PX, polygon)
        tilts = polygon.edge_on_tilts(frame.tilts(heights))
        heights, apothems = straight_profile(heights, apothems, tilts)
        return cls(polygon, frame, heights, apothems)

    @property
    def inverse_focal(self) -> float:
        """1 over the focal length in pixels, 0 for parallel rays."""
        return self.frame.inverse_focal

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (F, 3) of the visible faces, camera frame; later ones hide earlier ones."""
        return np.asarray(self._normals[self._parts, self._sides])

    @cached_property
    def corners(self) -> np.ndarray:
        """Images (F, 4, 2) of the visible faces' corners, as `normals`."""
        before = self._sides - 1
        corners = [(self._parts, before), (self._parts, self._sides), (self._parts + 1, self._sides)]
        return np.stack([self._images[corner] for corner in [*corners, (self._parts + 1, before)]], axis=1)

    @cached_property
    def creases(self) -> Creases:
        """Edges between visible faces that turn from one another."""
        numbers = np.full(self._normals.shape[:2], -1)
        numbers[self._parts, self._sides] = np.arange(len(self._parts))
        images, before = self._images, np.roll(self._images, 1, axis=1)
        # Edges to the next side of the same part, and to the same side of the next part.
        first = np.concatenate([numbers.ravel(), numbers[:-1].ravel()])
        second = np.concatenate([np.roll(numbers, -1, axis=1).ravel(), numbers[1:].ravel()])
        starts = np.concatenate([images[:-1].reshape(-1, 2), before[1:-1].reshape(-1, 2)])
        ends = np.concatenate([images[1:].reshape(-1, 2), images[1:-1].reshape(-1, 2)])
        faces = np.stack([first, second], axis=1)
        directions = np.cross(self.normals[faces[:, 0]], self.normals[faces[:, 1]])
        turns = np.linalg.norm(directions, axis=1)
        used = (faces >= 0).all(axis=1) & (turns > np.sin(np.radians(MIN_CREASE_DEG)))
        return Creases(starts[used], ends[used], directions[used] / turns[used, None], faces[used])

    def faces(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the number (H, W) of the visible face at each pixel of an image of this shape, -1 beside the body."""
        result = np.full(shape, -1, np.int16)
        pixels = np.round(to_pixels(self.corners, shape) * 2**SUBPIXEL_BITS).astype(np.int32)
        for number, corners in enumerate(pixels):
            cv2.fillPoly(result, [corners], number, shift=SUBPIXEL_BITS)
        return result

    def depths(self, x: np.ndarray, y: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return z (N,) in pixels of the faces (N,) at image positions x, y (N,), up to a constant for all."""
        points = np.column_stack([x, y, np.zeros(len(x))])
        rays = to_camera_directions(x, y, self.inverse_focal)
        anchors, normals = self._points[self._parts, self._sides][faces], self.normals[faces]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(((anchors - points) * normals).sum(axis=1) / (rays * normals).sum(axis=1))

    @cached_property
    def _points(self) -> np.ndarray:
        """Corners (M, S, 3) of the rings in the camera frame; side k lies between the corners k - 1 and k."""
        rings = self.apothems[:, None, None] * self.polygon.corners
        heights = np.broadcast_to(self.heights[:, None, None], (*rings.shape[:2], 1))
        return np.concatenate([rings, heights], axis=-1) @ self.frame.vectors + np.append(self.frame.point, 0.0)

    @cached_property
    def _images(self) -> np.ndarray:
        """Images (M, S, 2) of the corners."""
        return np.asarray(self._points[..., :2] / (1.0 - self.inverse_focal * self._points[..., 2:]))

    @cached_property
    def _normals(self) -> np.ndarray:
        """Unit normals (M - 1, S, 3) of all faces, camera frame."""
        rise, widening = np.diff(self.heights), np.diff(self.apothems)
        across = rise[:, None, None] * self.polygon.outward
        along = np.broadcast_to(-widening[:, None, None], (*across.shape[:2], 1))
        return np.asarray(unit(np.concatenate([across, along], axis=-1)) @ self.frame.vectors)

    @cached_property
    def _visible(self) -> tuple[np.ndarray, np.ndarray]:
        """Parts (F,) and sides (F,) of the visible faces, those first that others may hide."""
        images = (self._images[:-1] + self._images[1:]) / 2.0
        images = (images + np.roll(images, 1, axis=1)) / 2.0
        view = unit(to_camera_directions(images[..., 0], images[..., 1], self.inverse_focal))
        parts, sides = np.nonzero((self._normals * view).sum(axis=-1) > MIN_FACING)
        # What is nearer to the end that faces the camera hides what is behind it.
        order = np.arange(len(parts)) if self.frame.tilts(self.heights).mean() >= 0.0 else np.arange(len(parts))[::-1]
        return parts[order], sides[order]

    @property
    def _parts(self) -> np.ndarray:
        return self._visible[0]

    @property
    def _sides(self) -> np.ndarray:
        return self._visible[1]
