"""The simulated camera: orthographic, or a pinhole at a distance."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera over a frame of width x height pixels; x right, y up, z towards it, the frame's centre at the origin.

    distance: of the pinhole from the plane z = 0, where one pixel covers one unit of length; None: orthographic.
    """

    width: int
    height: int
    distance: float | None = None

    @property
    def matrix(self) -> np.ndarray | None:
        """The 3 x 3 matrix in pixels; None of an orthographic camera."""
        if self.distance is None:
            return None
        across, down = (self.width - 1) / 2, (self.height - 1) / 2
        return np.array([[self.distance, 0.0, across], [0.0, self.distance, down], [0.0, 0.0, 1.0]])

    def rays(self, columns: np.ndarray, rows: np.ndarray, top: float) -> tuple[np.ndarray, np.ndarray]:
        """Origins (N, 3) in the plane z = top, which lies before the scene, and unit directions (N, 3) of the rays
        through pixel positions columns, rows (N,)."""
        x, y = columns - (self.width - 1) / 2, (self.height - 1) / 2 - rows
        origins = np.stack([x, y, np.full(x.shape, top)], axis=-1).astype(np.float64)
        directions = np.zeros_like(origins)
        directions[:, 2] = -1.0
        if self.distance is not None:
            origins[:, :2] *= 1.0 - top / self.distance
            directions[:, 0], directions[:, 1] = x / self.distance, y / self.distance
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return origins, directions

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Camera-frame x, y (N, 2) in pixels at which points (N, 3) appear."""
        if self.distance is None:
            return points[:, :2]
        return points[:, :2] / (1.0 - points[:, 2:] / self.distance)
