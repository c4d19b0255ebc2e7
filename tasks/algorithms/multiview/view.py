"""A view of an object: what one capture knows, and where its camera stood.

World coordinates are those of the poses: for a turntable its axis is y and y = 0 is the frame's centre row. A point X
of the world is at R X + t in the camera frame (x right, y up, z to the camera).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage


@dataclass(frozen=True, slots=True)
class View:
    """One capture of an object.

    mask (H, W) bool, normals (H, W, 3) float32 (camera frame, unit, NaN outside the mask) and confidence (H, W) float32
    of the region whose top-left pixel is `origin` (column, row) of a full frame of `frame` (width, height) pixels.
    rotation (3, 3) and translation (3,) take the world to the camera frame. Orthographic: `pixel_size` world units a
    pixel, the camera frame's origin in the frame's centre. With a camera `matrix` (3, 3; pixels of the full frame) the
    origin is the camera.
    """

    name: str
    mask: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    origin: tuple[int, int]
    frame: tuple[int, int]
    pixel_size: float = 1.0
    matrix: np.ndarray | None = None

    def placed(self, rotation: np.ndarray, translation: np.ndarray) -> "View":
        """The same view from elsewhere."""
        return replace(self, rotation=np.asarray(rotation, float), translation=np.asarray(translation, float))

    def seeing(self, normals: np.ndarray, confidence: np.ndarray) -> "View":
        """The same view with other normals (H, W, 3) and confidence (H, W)."""
        return replace(self, normals=normals, confidence=confidence)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows (..., ) of the region at which points (..., 3) of the world appear."""
        x, y, z = np.moveaxis(points @ self.rotation.T + self.translation, -1, 0)
        if self.matrix is None:
            column = (self.frame[0] - 1) / 2 + x / self.pixel_size
            row = (self.frame[1] - 1) / 2 - y / self.pixel_size
        else:
            away = np.maximum(-z, 1e-9)
            right, down = x / away, -y / away
            column = self.matrix[0, 0] * right + self.matrix[0, 1] * down + self.matrix[0, 2]
            row = self.matrix[1, 1] * down + self.matrix[1, 2]
        return column - self.origin[0], row - self.origin[1]

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Starts and unit directions (N, 3) in the world of the rays from the camera through the region's pixels.

        An orthographic ray starts in the plane through the camera frame's origin.
        """
        column, row = np.asarray(columns, float) + self.origin[0], np.asarray(rows, float) + self.origin[1]
        if self.matrix is None:
            x = (column - (self.frame[0] - 1) / 2) * self.pixel_size
            y = ((self.frame[1] - 1) / 2 - row) * self.pixel_size
            starts = np.stack([x, y, np.zeros_like(x)], axis=-1)
            directions = np.broadcast_to([0.0, 0.0, -1.0], starts.shape)
        else:
            down = (row - self.matrix[1, 2]) / self.matrix[1, 1]
            right = (column - self.matrix[0, 2] - self.matrix[0, 1] * down) / self.matrix[0, 0]
            directions = np.stack([right, -down, -np.ones_like(right)], axis=-1)
            directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
            starts = np.zeros_like(directions)
        return (starts - self.translation) @ self.rotation, directions @ self.rotation

    def towards(self, points: np.ndarray) -> np.ndarray:
        """Unit vectors (N, 3) of the world from points (N, 3) to the camera."""
        if self.matrix is None:
            return np.broadcast_to(self.rotation[2], points.shape)
        away = -self.translation @ self.rotation - points
        return away / np.linalg.norm(away, axis=-1, keepdims=True)

    def footprint(self, points: np.ndarray) -> np.ndarray:
        """World units (N,) that a pixel covers at points (N, 3)."""
        if self.matrix is None:
            return np.full(len(points), self.pixel_size)
        away = -(points @ self.rotation[2] + self.translation[2])
        return np.asarray(np.maximum(away, 1e-9) / np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))

    def normals_at(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) of the camera frame at positions of the region; zero where none is near."""
        normals = sample(np.nan_to_num(self.normals), columns, rows)
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9))

    def to_world(self, vectors: np.ndarray) -> np.ndarray:
        """Directions (..., 3) of the camera frame in the world."""
        return vectors @ self.rotation


def sample(values: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Bilinear samples (N,) or (N, C) of values (H, W) or (H, W, C); beyond the border its nearest pixel."""
    if values.ndim == 3:
        return np.stack([sample(values[..., c], columns, rows) for c in range(values.shape[2])], axis=-1)
    return np.asarray(ndimage.map_coordinates(values, [rows, columns], order=1, mode="nearest"))


def turned(degrees: float) -> np.ndarray:
    """Rotation (3, 3) about the upward axis, counter-clockwise seen from above: world to camera on a turntable."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
