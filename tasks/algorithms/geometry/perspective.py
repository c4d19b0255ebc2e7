"""A perspective camera: each pixel has its own line of sight, and a ball is seen as an ellipse.

Half vectors are kept between the light and V0 = (0, 0, 1), whatever the camera: one per frame. `towards` makes of them
what a pixel sees along its own ray. To label normals, each pixel's are turned so that its ray is the z axis (`facing`):
there a rim normal has n_z = 0, and the slope of a smooth surface is that of the logarithm of its distance.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, unit

AHEAD = np.array([1.0, -1.0, -1.0])
"""Turns the camera frame (y up, z to the camera) into that of camera matrices (y down, z ahead), and back."""
STRAIGHT = np.array([0.0, 0.0, 1.0])


def views(camera: np.ndarray, shape: tuple[int, ...], left: float, top: float) -> np.ndarray:
    """View vectors (H, W, 3), unit, from the surface to the camera, of a region whose first pixel is (left, top).

    camera (3, 3) is the matrix of the full frame in pixels.
    """
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return _view(camera, columns + left, rows + top)


def towards(half_vectors: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Half vectors (..., 3) float32 between the same lights and view vectors (..., 3) instead of V0."""
    return unit(lights_of(half_vectors.astype(np.float64)) + view).astype(np.float32)


def straight(normals: np.ndarray, view: np.ndarray) -> np.ndarray:
    """The half vectors (..., 3) float32 under which normals (..., 3) glint along view vectors (..., 3)."""
    lights = 2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view
    return half_vectors_of(lights).astype(np.float32)


def facing(vectors: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) float32 turned, the shortest way, so that view vectors (..., 3) become the z axis."""
    return _turned(vectors, view, STRAIGHT)


def in_camera(vectors: np.ndarray, view: np.ndarray) -> np.ndarray:
    """The inverse of `facing`."""
    return _turned(vectors, STRAIGHT, view)


@dataclass(frozen=True, slots=True)
class Cone:
    """The rays that meet a ball: direction (3,), unit, from the camera to its centre; sine of the half angle, which is
    the ball's radius over its distance."""

    axis: np.ndarray
    sine: float

    def slopes(self, view: np.ndarray) -> np.ndarray:
        """Sine (...) of the angle between view vectors (..., 3) and the ball's normals; above 1 beside the ball."""
        return np.linalg.norm(np.cross(view, self.axis), axis=-1) / self.sine

    def normals(self, view: np.ndarray) -> np.ndarray:
        """The ball's normals (..., 3) where view vectors (..., 3) come from; beside the ball the nearest rim's."""
        rays = -view
        along = rays @ self.axis
        near = along - np.sqrt(np.maximum(along**2 - (1.0 - self.sine**2), 0.0))
        return unit(rays * near[..., None] - self.axis)

    def outline(self, camera: np.ndarray) -> tuple[float, float, float]:
        """The outline's centre x, y and mean radius (that of a circle of its area) in pixels of the camera's frame."""
        across, down, ahead = self.axis * AHEAD
        room = ahead**2 - self.sine**2
        x, y, _ = camera @ np.array([across * ahead / room, down * ahead / room, 1.0])
        area = self.sine**2 * np.sqrt(1.0 - self.sine**2) / room**1.5
        return float(x), float(y), float(np.sqrt(area * camera[0, 0] * camera[1, 1]))


def cone_of(x: float, y: float, radius: float, camera: np.ndarray) -> Cone:
    """The ball whose outline has the centre (x, y) and the mean radius in pixels, seen by a camera (3, 3)."""
    cone = Cone(-_view(camera, np.array(x), np.array(y)), 0.0)
    sight, size = np.array([x, y]), radius
    for _ in range(8):
        focal = np.sqrt(camera[0, 0] * camera[1, 1])
        sine = float(size / focal * abs(cone.axis[2]) ** 1.5)
        cone = Cone(-_view(camera, *sight), min(sine, 0.9))
        found = cone.outline(camera)
        sight = sight + np.array([x, y]) - found[:2]
        size *= radius / found[2]
    return cone


@dataclass(frozen=True, slots=True)
class Turned:
    """A camera turned to look at a ball, whose outline is a circle then.

    camera (3, 3) as it stands; matrix (3, 3) of the turned one, whose small square frame has the ball in its `middle`;
    rotation (3, 3) to it; both have y down and z ahead here.
    """

    camera: np.ndarray
    matrix: np.ndarray
    rotation: np.ndarray

    @classmethod
    def to(cls, x: float, y: float, radius: float, camera: np.ndarray) -> "Turned":
        """Turn a camera (3, 3) to the ball with an outline of that centre and mean radius, which it keeps."""
        ahead = cone_of(x, y, radius, camera).axis * AHEAD
        middle = float(np.ceil(1.6 * radius))
        focal = float(np.sqrt(camera[0, 0] * camera[1, 1]) / ahead[2] ** 1.5)
        right = unit(np.cross([0.0, 1.0, 0.0], ahead))
        matrix = np.array([[focal, 0.0, middle], [0.0, focal, middle], [0.0, 0.0, 1.0]])
        return cls(camera, matrix, np.stack([right, np.cross(ahead, right), ahead]))

    @property
    def middle(self) -> float:
        """Column and row of the ball's centre."""
        return float(self.matrix[0, 2])

    def picture(self, picture: np.ndarray) -> np.ndarray:
        """What the turned camera sees, float32, of the other's picture (H, W)."""
        back = self.camera @ self.rotation.T @ np.linalg.inv(self.matrix)
        size = (2 * int(self.middle) + 1,) * 2
        flags, edge = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        return cv2.warpPerspective(picture.astype(np.float32), back, size, flags=flags, borderMode=edge)

    def back(self, x: float, y: float, radius: float) -> tuple[float, float, float]:
        """Centre and mean radius, in the camera's own frame, of an outline that is a circle in the turned one."""
        cone = cone_of(x, y, radius, self.matrix)
        return Cone(self.rotation.T @ (cone.axis * AHEAD) * AHEAD, cone.sine).outline(self.camera)


def _view(camera: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    rays = np.stack([x, y, np.ones(np.shape(x))], axis=-1) @ np.linalg.inv(camera).T
    return unit(-rays * AHEAD)


def _turned(vectors: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    middle = start + end
    share = (vectors * middle).sum(axis=-1, keepdims=True) / (1.0 + (start * end).sum(axis=-1, keepdims=True))
    turned = vectors - share * middle + 2.0 * (vectors * start).sum(axis=-1, keepdims=True) * end
    return turned.astype(np.float32)
