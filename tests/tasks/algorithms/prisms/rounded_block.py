"""A box of glass with round edges, rendered from its distance function, under either camera."""

from dataclasses import dataclass

import numpy as np

from tests.tasks.algorithms.prisms.block import Block
from tests.tasks.algorithms.prisms.rendered import rendered, rounded_box_distance

SHAPE = (150, 150)
INVERSE_FOCAL = 1.0 / 400.0
CAMERA = np.array([[1 / INVERSE_FOCAL, 0.0, 74.5], [0.0, 1 / INVERSE_FOCAL, 74.5], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class RoundedBlock:
    """A box about the origin with a square section, which a ball of this radius in pixels has grown from another.

    slope: degrees by which its axis leans towards the camera. turn: degrees about the axis.
    """

    slope: float = 38.0
    turn: float = 30.0
    half_width: float = 40.0
    half_height: float = 32.0
    radius: float = 13.0
    inverse_focal: float = 0.0

    @property
    def core(self) -> Block:
        """The box that the ball has grown."""
        turns = tuple(self.turn + quarter for quarter in (0.0, 90.0, 180.0, 270.0))
        width, height = self.half_width - self.radius, self.half_height - self.radius
        return Block(self.slope, turns, width, height, self.inverse_focal, SHAPE)

    @property
    def rotation(self) -> np.ndarray:
        """Rotation (3, 3) from the frame of the box, y along its axis, to that of the camera."""
        up, _, front, side = self.core.normals[:4]
        return np.column_stack([side, up, front])

    def render(self) -> tuple[np.ndarray, np.ndarray]:
        """Return normals (H, W, 3), camera frame, and z (H, W); NaN beside the box."""
        high = float(np.linalg.norm([self.half_width, self.half_height, self.half_width]))
        return rendered(self._distance, high, SHAPE, self.inverse_focal)

    def _distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distances (N,) of points (N, 3) from the box, negative inside."""
        half = np.array([self.half_width, self.half_height, self.half_width])
        beyond = np.abs(points @ self.rotation) - half + self.radius
        return rounded_box_distance(beyond, self.radius)
