"""A view: what one capture shows of an object, and the pose of its camera.

World coordinates are those of the poses: on a turntable the axis is y, and y = 0 is the row of the camera's optical
axis, that of an orthographic camera the frame's centre row. A point X of the world is at R X + t in the camera frame (x
right, y up, z to the camera). Projection, rays and footprint are those of a pinhole or an orthographic camera (Hartley
and Zisserman, Multiple View Geometry in Computer Vision, chapter 6).
The silhouette's signed distance is an exact Euclidean distance transform (Maurer, Qi and Raghavan 2003, as in SciPy).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.contours import outermost_pixels

STAIRCASE_SIGMA_PX = 1.0
"""Standard deviation in pixels of the Gaussian that smooths the staircase of a mask's silhouette."""
MARGIN_SHARE = 0.5
"""Margin around the region in which silhouette distances are computed, as a share of the region's longer side."""
MIN_DEPTH = 1e-9
"""Smallest distance in front of a pinhole camera, world units: points behind it must not divide by zero."""


@dataclass(frozen=True, slots=True)
class SilhouetteDistance:
    """Signed distance to a mask's silhouette in pixels, negative inside, on the region and `margin` pixels around it.

    distance, along_columns, along_rows: (H + 2 margin, W + 2 margin) float64, the distance and its two derivatives.
    """

    distance: np.ndarray
    along_columns: np.ndarray
    along_rows: np.ndarray
    margin: int

    @classmethod
    def from_mask(cls, mask: np.ndarray) -> "SilhouetteDistance":
        """Compute the distance to the silhouette of a mask (H, W) bool.

        Where the mask touches the region's border the object is cropped: its silhouette is continued outwards.
        """
        margin = int(MARGIN_SHARE * max(mask.shape)) + 8
        padded = np.pad(mask, margin, mode="edge")
        distance = ndimage.distance_transform_edt(~padded) - ndimage.distance_transform_edt(padded)
        # The silhouette runs half-way between the outermost pixels inside and the innermost ones outside.
        distance = ndimage.gaussian_filter(distance - 0.5 * np.sign(distance), STAIRCASE_SIGMA_PX)
        along_rows, along_columns = np.gradient(distance)
        return cls(distance, along_columns, along_rows, margin)

    def at(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the distances (N,) in pixels at columns and rows (N,) of the region."""
        return sample(self.distance, columns + self.margin, rows + self.margin)

    def gradient(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the gradients (N, 3) of the distance in the camera frame, per pixel, at columns and rows (N,)."""
        x, y = (
            sample(self.along_columns, columns + self.margin, rows + self.margin),
            sample(self.along_rows, columns + self.margin, rows + self.margin),
        )
        return np.stack([x, -y, np.zeros_like(x)], axis=-1)


class SilhouetteMask:
    """A mask (H, W) bool, which must not be changed, with the distance to its silhouette, computed on first use."""

    def __init__(self, mask: np.ndarray) -> None:
        self.mask = mask

    @cached_property
    def distance(self) -> SilhouetteDistance:
        """The signed distance to the silhouette."""
        return SilhouetteDistance.from_mask(self.mask)


@dataclass(frozen=True, slots=True)
class View:
    """One capture of an object.

    silhouette: the mask (H, W) of the object; normals (H, W, 3) float32, camera frame, unit, NaN outside the mask;
    evidence (H, W) float32 in 0..1, their confidence if the inputs that they share (spheres, lights, camera, mask) are
    right, and `trust` (H, W), or one for all, the probability that these are: normals that err in common still tell
    which pose is the best. All cover the region whose top-left pixel is `origin` (column, row) of a full frame of
    `frame` (width, height) pixels.
    rotation (3, 3) and translation (3,) take the world to the camera frame. Orthographic: `pixel_size` world units per
    pixel, the camera frame's origin in the frame's centre. With a camera `matrix` (3, 3; pixels of the full frame) the
    origin is the camera.
    """

    name: str
    silhouette: SilhouetteMask
    normals: np.ndarray
    evidence: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    origin: tuple[int, int]
    frame: tuple[int, int]
    pixel_size: float = 1.0
    matrix: np.ndarray | None = None
    trust: np.ndarray | float = 1.0

    @property
    def confidence(self) -> np.ndarray:
        """The confidence (H, W) of the normals."""
        return self.evidence * self.trust

    @property
    def mask(self) -> np.ndarray:
        """The object's mask (H, W) bool."""
        return self.silhouette.mask

    def with_pose(self, rotation: np.ndarray, translation: np.ndarray) -> "View":
        """Return the same view from another pose: rotation (3, 3), translation (3,), world to camera."""
        return replace(self, rotation=np.asarray(rotation, float), translation=np.asarray(translation, float))

    @property
    def camera_to_world(self) -> np.ndarray:
        """The pose (4, 4) as a catalogue states it."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation.T, -self.rotation.T @ self.translation
        return matrix

    def with_camera_to_world(self, matrix: np.ndarray) -> "View":
        """Return the same view from the pose (4, 4) that a catalogue states."""
        return self.with_pose(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3])

    def with_normals(self, normals: np.ndarray, evidence: np.ndarray) -> "View":
        """Return the same view with other normals (H, W, 3) and evidence (H, W)."""
        return replace(self, normals=normals, evidence=evidence)

    def with_mask(self, mask: np.ndarray) -> "View":
        """Return the same view with another mask (H, W) bool."""
        return replace(self, silhouette=SilhouetteMask(mask))

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns and rows (...,) of the region at which points (..., 3) of the world appear."""
        x, y, z = np.moveaxis(points @ self.rotation.T + self.translation, -1, 0)
        if self.matrix is None:
            column = (self.frame[0] - 1) / 2 + x / self.pixel_size
            row = (self.frame[1] - 1) / 2 - y / self.pixel_size
        else:
            depth = np.maximum(-z, MIN_DEPTH)
            right, down = x / depth, -y / depth
            column = self.matrix[0, 0] * right + self.matrix[0, 1] * down + self.matrix[0, 2]
            row = self.matrix[1, 1] * down + self.matrix[1, 2]
        return column - self.origin[0], row - self.origin[1]

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return starts and unit directions (N, 3), world, of the rays from the camera through columns and rows (N,).

        An orthographic ray starts in the plane through the camera frame's origin.
        """
        column, row = np.asarray(columns, float) + self.origin[0], np.asarray(rows, float) + self.origin[1]
        if self.matrix is None:
            x = (column - (self.frame[0] - 1) / 2) * self.pixel_size
            y = ((self.frame[1] - 1) / 2 - row) * self.pixel_size
            starts = np.stack([x, y, np.zeros_like(x)], axis=-1)
            directions = np.broadcast_to([0.0, 0.0, -1.0], starts.shape)
        else:
            # The camera matrix is upper triangular: solve for the row first, then for the column.
            down = (row - self.matrix[1, 2]) / self.matrix[1, 1]
            right = (column - self.matrix[0, 2] - self.matrix[0, 1] * down) / self.matrix[0, 0]
            directions = np.stack([right, -down, -np.ones_like(right)], axis=-1)
            directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
            starts = np.zeros_like(directions)
        return (starts - self.translation) @ self.rotation, directions @ self.rotation

    def silhouette_pixels(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return columns and rows (count,) float64 of pixels on the silhouette, ordered around its centroid.

        Where the region's border crops the object, it does not count as silhouette.

        Raises:
            UnusableCapture: nothing else is left of it, or the mask is empty.
        """
        if not self.mask.any():
            raise UnusableCapture(f"the mask of {self.name} is empty", "correct it")
        contour = outermost_pixels(self.mask)
        if not contour.any():
            raise UnusableCapture(
                f"the mask of {self.name} fills its region, so that it has no silhouette",
                "enlarge the region of that capture, or correct its mask",
            )
        rows, columns = np.nonzero(contour)
        order = np.argsort(np.arctan2(rows - rows.mean(), columns - columns.mean()), kind="stable")
        chosen = order[np.linspace(0, len(order) - 1, count).round().astype(int)]
        return columns[chosen].astype(float), rows[chosen].astype(float)

    def view_vectors(self, points: np.ndarray) -> np.ndarray:
        """Return the unit vectors (N, 3), world, from points (N, 3) to the camera."""
        if self.matrix is None:
            return np.broadcast_to(self.rotation[2], points.shape)
        vectors = -self.translation @ self.rotation - points
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

    def footprint(self, points: np.ndarray) -> np.ndarray:
        """Return the world units (N,) that a pixel covers at points (N, 3)."""
        if self.matrix is None:
            return np.full(len(points), self.pixel_size)
        depth = -(points @ self.rotation[2] + self.translation[2])
        return np.asarray(np.maximum(depth, MIN_DEPTH) / np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))

    def normals_at(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return unit normals (N, 3), camera frame, at columns and rows (N,) of the region; zero far from any known."""
        normals = sample(np.nan_to_num(self.normals), columns, rows)
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9))

    def to_world(self, vectors: np.ndarray) -> np.ndarray:
        """Rotate directions (..., 3) of the camera frame into the world."""
        return vectors @ self.rotation


def sample(values: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Sample values (H, W) or (H, W, C) bilinearly: (N,) or (N, C); outside, the value of the nearest border pixel."""
    if values.ndim == 3:
        return np.stack([sample(values[..., channel], columns, rows) for channel in range(values.shape[2])], axis=-1)
    return np.asarray(ndimage.map_coordinates(values, [rows, columns], order=1, mode="nearest"))


def rotation_about_y(degrees: float) -> np.ndarray:
    """Return the rotation (3, 3), world to camera, of a turntable: about y, counter-clockwise seen from above."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
