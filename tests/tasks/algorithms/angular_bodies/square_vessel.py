"""Square and rectangular vessels of glass, rendered from their distance function, under either camera."""

from dataclasses import dataclass

import numpy as np

from tests.tasks.algorithms.prisms.rendered import rendered, rounded_box_distance

SHAPE = (170, 150)
INVERSE_FOCAL = 1.0 / 400.0
CAMERA = np.array([[1 / INVERSE_FOCAL, 0.0, 74.5], [0.0, 1 / INVERSE_FOCAL, 84.5], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class SquareVessel:
    """A vessel whose sections are rectangles with round corners; lengths in pixels.

    tilt: degrees by which its axis leans towards the camera. turn: degrees about the axis. half_width, half_depth: of
    its section at half its height. corner: radius of its corners. taper: degrees by which its walls lean outwards.
    wall: thickness of the wall round its hollow; None for a solid. neck: radius and length of a neck on its top.
    """

    tilt: float = 25.0
    turn: float = 20.0
    half_width: float = 36.0
    half_depth: float = 36.0
    half_height: float = 48.0
    corner: float = 12.0
    taper: float = 0.0
    wall: float | None = None
    neck: tuple[float, float] | None = None
    inverse_focal: float = 0.0

    def render(self) -> np.ndarray:
        """Return normals (H, W, 3), camera frame, NaN beside the vessel."""
        high = float(np.linalg.norm([1.5 * self.half_width, 1.5 * self.half_depth, 2.0 * self.half_height]))
        return rendered(self._distance, high, SHAPE, self.inverse_focal)[0]

    @property
    def _rotation(self) -> np.ndarray:
        """Rotation (3, 3) from the frame of the vessel, y along its axis and z to its first side, to the camera's."""
        tilt, turn = np.radians([self.tilt, self.turn])
        up = np.array([0.0, np.cos(tilt), np.sin(tilt)])
        right, forward = np.array([1.0, 0.0, 0.0]), np.array([0.0, -np.sin(tilt), np.cos(tilt)])
        front = np.sin(turn) * right + np.cos(turn) * forward
        return np.column_stack([np.cross(up, front), up, front])

    def _distance(self, points: np.ndarray) -> np.ndarray:
        local = points @ self._rotation
        height = local[:, 1]
        result = np.maximum(self._beyond_walls(local, 0.0), np.abs(height) - self.half_height)
        if self.wall is not None:
            hollow = np.maximum(self._beyond_walls(local, self.wall), 2.0 * self.wall - self.half_height - height)
            result = np.maximum(result, -hollow)
        if self.neck is not None:
            radius, length = self.neck
            above = np.maximum(height - self.half_height - length, self.half_height - 2.0 - height)
            result = np.minimum(result, np.maximum(np.hypot(local[:, 0], local[:, 2]) - radius, above))
        return result

    def _beyond_walls(self, local: np.ndarray, wall: float) -> np.ndarray:
        """Return the distances (N,) of points (N, 3) from walls, or from the inner side of walls that are so thick."""
        size = 1.0 + np.tan(np.radians(self.taper)) * local[:, 1] / self.half_width
        corner = max(self.corner - wall, 2.0)
        half = np.array([self.half_depth, self.half_width]) - wall - corner
        beyond = np.abs(local[:, [0, 2]]) / size[:, None] - half
        return rounded_box_distance(beyond, corner)
