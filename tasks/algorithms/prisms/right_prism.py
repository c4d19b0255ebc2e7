"""Right prisms: two parallel polygons, and rectangles perpendicular to them round their sides.

Blocks, bars, paperweights and many bottles are right prisms. Such a solid is its base swept along its axis, and so its
silhouette is bounded by two edges along the axis, and by parts of the two ends (`SweptContour`). From these and the
slope of the axis all of its visible faces follow, whether they show the light or not: an edge of an end lies in the
plane through its image and the camera, and is perpendicular to the axis.

The view rays are parallel, or those of a perspective camera whose principal point is the origin.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import to_camera_directions
from glint.tasks.algorithms.geometry.vectors import unit

MAX_PARALLEL_DEG, MIN_LENGTH_RATIO = 8.0, 0.45
"""Angle between the images of two edges along the axis under parallel rays, and ratio of their lengths."""
SUBPIXEL_BITS = 4
"""Fractional bits of the corners of a face that is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class SweptContour:
    """Contour of a prism's silhouette: parts of its two ends, joined by two edges along the axis.

    visible: (F, 2), corners of the visible end on the contour, counter-clockwise. hidden: (N, 2), those of the hidden
    end, likewise: edges along the axis lead from its last corner to the first of the visible end, and back.
    """

    visible: np.ndarray
    hidden: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Crease:
    """Straight edge between two visible faces: image of its ends (2,), its direction (3,), and the faces' numbers."""

    start: np.ndarray
    end: np.ndarray
    direction: np.ndarray
    faces: tuple[int, int]


def to_pixels(points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return columns and rows (N, 2) of points (N, 2), x and y from the centre of an image of this shape."""
    return points * np.array([1.0, -1.0]) + (np.array(shape[::-1]) - 1.0) / 2.0


def swept_contours(
    corners: np.ndarray,
    inverse_focal: float = 0.0,
    max_angle_deg: float = MAX_PARALLEL_DEG,
    min_length_ratio: float = MIN_LENGTH_RATIO,
) -> list[SweptContour]:
    """Return the ways in which a polygon (N, 2), counter-clockwise, can be the contour of a prism.

    inverse_focal: 1 over the focal length in pixels; under perspective edges along the axis may converge. The others:
    angle between the images of two edges along the axis under parallel rays, and ratio of their lengths.
    """
    count = len(corners)
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    max_angle = np.radians(max_angle_deg) + inverse_focal * size / 2.0
    min_ratio = min_length_ratio - inverse_focal * size / 2.0
    result = []
    for first in range(count):
        for second in range(first + 2, count):
            cosine = -float(edges[first] @ edges[second]) / (lengths[first] * lengths[second])
            pair = sorted((lengths[first], lengths[second]))
            if cosine < np.cos(max_angle) or pair[0] < min_ratio * pair[1]:
                continue
            start = corners[np.arange(first + 1, second + 1)]
            end = corners[np.arange(second + 1, first + 1 + count) % count]
            if len(start) + len(end) > 4 and min(len(start), len(end)) >= 2:
                result += [SweptContour(start, end), SweptContour(end, start)]
    return result


@dataclass(frozen=True, eq=False)
class RightPrism:
    """Right prism with a given contour and slope of its axis.

    contour: of its silhouette. slope: angle in radians between the image plane and the axis, whose visible end is
    nearer to the camera. inverse_focal: 1 over the focal length in pixels, 0 for parallel rays.
    """

    contour: SweptContour
    slope: float
    inverse_focal: float = 0.0

    def seen_from(self, middle: np.ndarray, stride: int) -> "RightPrism":
        """Return the prism in an image of every `stride`-th pixel, whose centre lies at `middle` (2,) in this one."""
        visible, hidden = ((corners - middle) / stride for corners in (self.contour.visible, self.contour.hidden))
        return RightPrism(SweptContour(visible, hidden), self.slope, self.inverse_focal * stride)

    @cached_property
    def axis(self) -> np.ndarray:
        """Unit direction (3,) of the axis, towards the visible end."""
        hidden, visible = self.contour.hidden, self.contour.visible
        # Edges along the axis lie in the planes through the camera and their images, and so does it in their mean.
        plane = unit(self._plane(hidden[-1], visible[0]) + self._plane(hidden[0], visible[-1]))
        forward = unit(np.array([0.0, 0.0, 1.0]) - plane[2] * plane)
        return np.asarray(np.cos(self.slope) * np.cross(forward, plane) + np.sin(self.slope) * forward)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (F, 3) of the visible faces, camera frame: the end, then the sides along the hidden end."""
        return np.stack([self.axis, *(np.cross(edge, self.axis) for edge in self._end_edges)])

    @cached_property
    def corners(self) -> list[np.ndarray]:
        """Images (N, 2) of the visible faces' corners, as `normals`."""
        hidden, top = self.contour.hidden, self._top
        sides = [np.stack([hidden[k], hidden[k + 1], top[k + 1], top[k]]) for k in range(len(hidden) - 1)]
        return [np.concatenate([self.contour.visible, top[1:-1]]), *sides]

    @cached_property
    def creases(self) -> list[Crease]:
        """Edges between visible faces."""
        top, hidden = self._top, self.contour.hidden
        ends = [Crease(top[k], top[k + 1], edge, (0, k + 1)) for k, edge in enumerate(self._end_edges)]
        sides = [Crease(hidden[k], top[k], self.axis, (k, k + 1)) for k in range(1, len(hidden) - 1)]
        return ends + sides

    def faces(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the number (H, W) of the visible face at each pixel of an image of this shape, -1 beside the prism."""
        result = np.full(shape, -1, np.int16)
        for number, corners in reversed(list(enumerate(self.corners))):
            pixels = to_pixels(corners, shape) * 2**SUBPIXEL_BITS
            cv2.fillPoly(result, [np.round(pixels).astype(np.int32)], number, shift=SUBPIXEL_BITS)
        return result

    def depths(self, x: np.ndarray, y: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return z (N,) in pixels of the faces (N,) at image positions x, y (N,), up to a constant for all."""
        points = np.column_stack([x, y, np.zeros(len(x))])
        rays = to_camera_directions(x, y, self.inverse_focal)
        anchors, normals = self.anchors, self.normals[faces]
        with np.errstate(divide="ignore", invalid="ignore"):
            result = ((anchors[faces] - points) * normals).sum(axis=1) / (rays * normals).sum(axis=1)
        return np.asarray(result)

    @cached_property
    def anchors(self) -> np.ndarray:
        """A point (F, 3) in space on each visible face, as `normals`."""
        hidden = self._hidden_points
        return np.stack([hidden[0] + self.height * self.axis, *hidden[:-1]])

    @cached_property
    def visible_end(self) -> np.ndarray:
        """Corners (N, 3) of the visible end in space: those above the hidden end, and those that it alone has."""
        beyond = self._points_across(self.contour.visible[1:-1], self.anchors[0])
        return np.concatenate([beyond, self._hidden_points + self.height * self.axis])

    @cached_property
    def height(self) -> float:
        """Distance between the ends in pixels, from the shorter edge along the axis.

        An edge looks too long where the short edge beside it is hardly seen to turn from it.
        """
        heights = []
        for corner, image in ((0, -1), (-1, 0)):
            point, top = self._hidden_points[corner], self.contour.visible[image]
            along = self.axis[:2] + self.inverse_focal * self.axis[2] * top
            distance = top * (1.0 - self.inverse_focal * point[2]) - point[:2]
            heights.append(float(along @ distance / (along @ along)))
        return min(heights)

    def _plane(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the unit normal (3,) of the plane through the camera and the image of an edge."""
        return unit(np.cross(np.append(end - start, 0.0), to_camera_directions(start[0], start[1], self.inverse_focal)))

    @cached_property
    def _end_edges(self) -> list[np.ndarray]:
        """Unit directions (3,) of the ends' edges that bound the visible sides."""
        hidden = self.contour.hidden
        edges = []
        for start, end in pairwise(hidden):
            edge = unit(np.cross(self.axis, self._plane(start, end)))
            edges.append(edge * (np.sign(edge[:2] @ (end - start)) or 1.0))
        return edges

    @cached_property
    def _hidden_points(self) -> np.ndarray:
        """Corners (N, 3) of the hidden end in space: on their rays, in a plane perpendicular to the axis."""
        hidden = self.contour.hidden
        return self._points_across(hidden, np.append(hidden[0], 0.0))

    def _points_across(self, images: np.ndarray, anchor: np.ndarray) -> np.ndarray:
        """Return the points (N, 3) with images (N, 2) in the plane through an anchor (3,) perpendicular to the axis."""
        starts = np.column_stack([images, np.zeros(len(images))])
        rays = to_camera_directions(images[:, 0], images[:, 1], self.inverse_focal)
        return starts + (((anchor - starts) @ self.axis) / (rays @ self.axis))[:, None] * rays

    @cached_property
    def _top(self) -> np.ndarray:
        """Images (N, 2) of the visible end's corners above those of the hidden one."""
        points = self._hidden_points + self.height * self.axis
        return np.asarray(points[:, :2] / (1.0 - self.inverse_focal * points[:, 2:]))


def right_prisms(corners: np.ndarray, inverse_focal: float, slopes_deg: Iterable[float]) -> list[RightPrism]:
    """Return the prisms with a contour (N, 2), see `swept_contours`, whose axes have these slopes in degrees."""
    return [
        RightPrism(contour, float(np.radians(slope)), inverse_focal)
        for contour in swept_contours(corners, inverse_focal)
        for slope in slopes_deg
    ]
