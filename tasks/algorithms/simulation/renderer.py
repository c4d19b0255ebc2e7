"""Frames of a traced scene under a moving lamp, as a camera would record them."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from glint.tasks.algorithms.simulation.environment import Room
from glint.tasks.algorithms.simulation.ray_tracing import Paths

GAIN = 40.0
"""Radiance of the lamp's centre relative to white: a direct highlight on glass (4%) clips inside its disc."""
SPILL = 0.05
"""Irradiance of the matte plane by a lamp at the zenith, relative to white."""
REACH = 2.4
"""Lamp radii within which its glow is followed."""
CELL = 2.0
"""Edge in degrees of the cells in which paths are kept by direction."""
GAMMA = 1.0 / 2.2


@dataclass(frozen=True, slots=True)
class Renderer:
    """A scene ready to be lit: paths by cells of their direction, the static picture, the matte plane's share.

    static, matte (H, W) float32, linear; directions (N, 3), origins (N, 3), weights (N,), pixels (N,) sorted by cell;
    starts (cells + 1,).
    """

    static: np.ndarray
    matte: np.ndarray
    directions: np.ndarray
    origins: np.ndarray
    weights: np.ndarray
    pixels: np.ndarray
    starts: np.ndarray
    size: int
    lamp_radius: float

    def render(self, light: np.ndarray, distance: float | None = None) -> np.ndarray:
        """Linear picture (H, W) float32, 1 = white, under a lamp in direction light (3,); NaN: the lamp is off.

        distance: of the lamp from the frame's centre in pixels; None: far away.
        """
        picture = self.static.copy()
        if not np.isfinite(light).all():
            return picture
        if light[2] > 0:
            picture += self.matte * np.float32(SPILL * light[2])
        place = np.asarray(light, np.float64)
        near = 0.0 if distance is None else 1.0 / distance
        reach = REACH * self.lamp_radius + (0.0 if distance is None else np.arctan(self.static.shape[1] * near))
        _glow(
            picture.reshape(-1), place, near, self.directions, self.origins, self.weights, self.pixels, self.starts,
            self.size, reach, self.lamp_radius,
        )  # fmt: skip
        return picture


def prepare(paths: Paths, room: Room, shape: tuple[int, int], lamp_radius: float) -> Renderer:
    """Sort the paths, and sum what does not move. shape (H, W) of the frame; lamp_radius in radians."""
    light, reflectance = room.radiance(paths.origin, paths.direction)
    count = shape[0] * shape[1]
    static = np.bincount(paths.pixel, paths.weight * light, count) + 0.02 * paths.matte.ravel()
    matte = np.bincount(paths.pixel, paths.weight * reflectance, count) + 0.5 * paths.matte.ravel()
    # The camera is no lamp, and what looks past everything into the room behind the plane sees no lamp either.
    free = (paths.bounces > 0) & (paths.direction[:, 2] > -0.3)
    size = int(np.ceil(2.0 * np.sqrt(2.0) / np.radians(CELL))) + 2
    cells = _cells(paths.direction[free], size)
    order = np.argsort(cells, kind="stable")
    starts = np.searchsorted(cells[order], np.arange(size * size + 1))
    return Renderer(
        static.reshape(shape).astype(np.float32),
        matte.reshape(shape).astype(np.float32),
        np.ascontiguousarray(paths.direction[free][order]),
        np.ascontiguousarray(paths.origin[free][order]),
        paths.weight[free][order],
        paths.pixel[free][order],
        starts.astype(np.int64),
        size,
        lamp_radius,
    )


def expose(
    picture: np.ndarray, noise: np.ndarray, exposure: float = 1.0, shift: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """The camera's 8-bit frame of a linear picture (H, W): gamma, noise (H, W) in levels, clipping."""
    if shift != (0.0, 0.0):
        import cv2

        move = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
        picture = cv2.warpAffine(picture, move, picture.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
    return _developed(picture.ravel(), noise.ravel(), np.float32(exposure), _CURVE).reshape(picture.shape)


_CURVE = (255.0 * np.linspace(0.0, 1.0, 4097) ** GAMMA).astype(np.float32)


@njit(cache=True, nogil=True)
def _developed(picture: np.ndarray, noise: np.ndarray, exposure: float, curve: np.ndarray) -> np.ndarray:
    result = np.empty(len(picture), np.uint8)
    for i in range(len(picture)):
        light = min(max(picture[i] * exposure, 0.0), 1.0)
        level = curve[int(light * 4096.0)] + noise[i]
        result[i] = np.uint8(min(max(level + 0.5, 0.0), 255.0))
    return result


def _cells(directions: np.ndarray, size: int) -> np.ndarray:
    """Cell (N,) of each direction with z > -1 in an equal-area map of the sphere's front and flanks."""
    plane = directions[:, :2] / np.sqrt(np.maximum((1.0 + directions[:, 2:]) / 2.0, 1e-6))
    index = np.floor(plane / np.radians(CELL) + size / 2).astype(np.int64).clip(0, size - 1)
    return index[:, 1] * size + index[:, 0]


@njit(cache=True, nogil=True)
def _glow(
    picture: np.ndarray,
    light: np.ndarray,
    near: float,
    directions: np.ndarray,
    origins: np.ndarray,
    weights: np.ndarray,
    pixels: np.ndarray,
    starts: np.ndarray,
    size: int,
    reach: float,
    radius: float,
) -> None:
    """Add the lamp's glow along all paths near its direction; `near` is one over its distance, 0 far away."""
    cell = np.radians(CELL)
    scale = np.sqrt(max((1.0 + light[2]) / 2.0, 1e-6))
    u, v = light[0] / scale / cell + size / 2, light[1] / scale / cell + size / 2
    # Cells stretch towards the flanks by at most the square root of two.
    span = reach * 1.5 / cell + 1.0
    for row in range(max(0, int(v - span)), min(size, int(v + span) + 1)):
        for column in range(max(0, int(u - span)), min(size, int(u + span) + 1)):
            for k in range(starts[row * size + column], starts[row * size + column + 1]):
                x, y, z = light[0], light[1], light[2]
                if near > 0.0:
                    x, y, z = x - origins[k, 0] * near, y - origins[k, 1] * near, z - origins[k, 2] * near
                    length = np.sqrt(x * x + y * y + z * z)
                    x, y, z = x / length, y / length, z / length
                gap = (x - directions[k, 0]) ** 2 + (y - directions[k, 1]) ** 2 + (z - directions[k, 2]) ** 2
                if gap < reach * reach:
                    picture[pixels[k]] += weights[k] * GAIN * np.exp(-((np.sqrt(gap) / radius) ** 3))
