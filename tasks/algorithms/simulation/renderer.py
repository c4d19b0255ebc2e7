"""Frames of a traced scene under a moving light, as an 8-bit camera records them.

A frame is the static image plus, for each path (`ray_tracing`), a soft lobe of the angle between its exit direction and
the light, times its weight. Paths are binned by direction in Lambert's azimuthal equal-area map, so that a frame visits
only those near the light.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.vectors import equal_area
from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.environment import Environment
from glint.tasks.algorithms.simulation.ray_tracing import Paths, Scene
from glint.tasks.algorithms.simulation.table_light import TableLight

LIGHT_RADIANCE = 40.0
"""Radiance of the light's centre relative to white: a direct highlight on glass (4%) clips inside its disc."""
MATTE_IRRADIANCE = 0.05
"""Irradiance of matte surfaces by a light at the zenith, relative to white."""
LOBE_REACH_RADII = 2.4
"""Angular distance in radii of the light up to which its lobe is evaluated."""
BIN_SIZE_DEG = 2.0
"""Edge of the bins of directions."""
GAMMA = 1.0 / 2.2
"""Exponent of the camera's levels over irradiance."""
CURVE_STEPS = 4096
"""Steps of the table of that curve: near black, where it is steepest, one is six levels."""


@dataclass(frozen=True, slots=True)
class Renderer:
    """A scene prepared for rendering under any light.

    static: (H, W) float32, linear image without the light.
    matte: (H, W) float32, linear response of matte surfaces to unit irradiance.
    directions, origins: (N, 3) float32; weights: (N,) float32; pixels: (N,) int32: paths, sorted by bin.
    starts: (bins + 1,) int64, first path of each bin.
    size: bins along either axis of the map.
    light_radius: angular radius of the light in radians, at which its lobe has fallen to 1/e.
    table: plane of the background, relative to the frame's centre.
    table_light: shadows and caustics on the table; None: it is lit as though nothing stood on it.
    """

    static: np.ndarray
    matte: np.ndarray
    directions: np.ndarray
    origins: np.ndarray
    weights: np.ndarray
    pixels: np.ndarray
    starts: np.ndarray
    size: int
    light_radius: float
    table: TablePlane
    table_light: TableLight | None = None

    def render(self, light: np.ndarray, distance: float | None = None) -> np.ndarray:
        """Render the linear image (H, W) float32, 1 = white, under a light.

        light: (3,) unit direction in the camera frame; NaN: the light is off. distance: of the light from the frame's
        centre in pixels; None: infinite.
        """
        image = self.static.copy()
        if not np.isfinite(light).all():
            return image
        direction = np.asarray(light, np.float64)
        if direction @ self.table.normal > 0:
            irradiance = MATTE_IRRADIANCE * _irradiance(self.matte.shape, self.table, light, distance)
            image += self.matte * irradiance.astype(np.float32)
            if self.table_light is not None:
                image += MATTE_IRRADIANCE * self.table_light.change(light, distance)
        inverse_distance = 0.0 if distance is None else 1.0 / distance
        # Under a near light the direction differs from pixel to pixel, so more bins may hold its paths.
        parallax = 0.0 if distance is None else np.arctan(self.static.shape[1] * inverse_distance)
        reach = LOBE_REACH_RADII * self.light_radius + parallax
        _add_lobe(
            image.reshape(-1), direction, inverse_distance, self.directions, self.origins, self.weights, self.pixels,
            self.starts, self.size, reach, self.light_radius,
        )  # fmt: skip
        return image


def _irradiance(shape: tuple[int, ...], table: TablePlane, light: np.ndarray, distance: float | None) -> np.ndarray:
    """Return the irradiance (H, W), or a scalar for a distant light, of the table relative to a zenith light's.

    light, distance: see `Renderer.render`; a near light is brighter on its own side, by the inverse square.
    """
    if distance is None:
        return np.asarray(light @ table.normal.astype(light.dtype))
    rows, columns = np.indices(shape)
    offset = table.points(columns - (shape[1] - 1) / 2, (shape[0] - 1) / 2 - rows)
    to_light = np.asarray(light, np.float64) - offset / distance
    return np.asarray(np.maximum(to_light @ table.normal, 0.0) / np.linalg.norm(to_light, axis=-1) ** 3)


def prepare_renderer(
    paths: Paths,
    environment: Environment,
    shape: tuple[int, int],
    light_radius: float,
    scene: Scene | None = None,
) -> Renderer:
    """Sort the paths by direction, and sum what does not depend on the light.

    shape: (H, W) of the frame; light_radius: angular, in radians; scene: of the solids that throw shadows and caustics
    on the table, None: none does.
    """
    light, reflectance = environment.radiance(paths.origin, paths.direction)
    count = shape[0] * shape[1]
    static = np.bincount(paths.pixel, paths.weight * light, count) + 0.02 * paths.matte.ravel()
    matte = np.bincount(paths.pixel, paths.weight * reflectance, count) + 0.5 * paths.matte.ravel()
    table_light = None
    if scene is not None:
        table_light = TableLight.prepare(scene, paths, environment.table, reflectance, shape, light_radius)
    # Rays that met nothing see no light, nor do those that leave into the room behind the table's plane.
    free = (paths.bounces > 0) & (paths.direction @ environment.table.normal > -0.3)
    size = int(np.ceil(2.0 * np.sqrt(2.0) / np.radians(BIN_SIZE_DEG))) + 2
    bins = _bins(paths.direction[free], size)
    order = np.argsort(bins, kind="stable")
    starts = np.searchsorted(bins[order], np.arange(size * size + 1))
    return Renderer(
        static.reshape(shape).astype(np.float32),
        matte.reshape(shape).astype(np.float32),
        np.ascontiguousarray(paths.direction[free][order]),
        np.ascontiguousarray(paths.origin[free][order]),
        paths.weight[free][order],
        paths.pixel[free][order],
        starts.astype(np.int64),
        size,
        light_radius,
        environment.table,
        table_light,
    )


def camera_response(image: np.ndarray, noise: np.ndarray, exposure: float, shift: tuple[float, float]) -> np.ndarray:
    """Return the camera's 8-bit frame (H, W) of a linear image (H, W): shift, exposure, gamma, noise, clipping.

    noise: (H, W) float32 in 8-bit levels; exposure: factor; shift: pixels to the right and down.
    """
    if shift != (0.0, 0.0):
        import cv2

        translation = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
        image = cv2.warpAffine(image, translation, image.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
    return _quantise(image.ravel(), noise.ravel(), np.float32(exposure), _GAMMA_CURVE).reshape(image.shape)


_GAMMA_CURVE = (255.0 * np.linspace(0.0, 1.0, CURVE_STEPS + 1) ** GAMMA).astype(np.float32)
"""8-bit level of linear intensities 0 to 1."""


@njit(cache=True, nogil=True)
def _quantise(image: np.ndarray, noise: np.ndarray, exposure: float, curve: np.ndarray) -> np.ndarray:
    result = np.empty(len(image), np.uint8)
    for i in range(len(image)):
        light = min(max(image[i] * exposure, 0.0), 1.0)
        level = curve[int(light * float(CURVE_STEPS))] + noise[i]
        result[i] = np.uint8(min(max(level + 0.5, 0.0), 255.0))
    return result


def _bins(directions: np.ndarray, size: int) -> np.ndarray:
    """Return the bin (N,) int64 of each direction (N, 3) with z > -1 in Lambert's azimuthal equal-area map."""
    index = np.floor(equal_area(directions) / np.radians(BIN_SIZE_DEG) + size / 2).astype(np.int64).clip(0, size - 1)
    return index[:, 1] * size + index[:, 0]


@njit(cache=True, nogil=True)
def _add_lobe(
    image: np.ndarray,
    light: np.ndarray,
    inverse_distance: float,
    directions: np.ndarray,
    origins: np.ndarray,
    weights: np.ndarray,
    pixels: np.ndarray,
    starts: np.ndarray,
    size: int,
    reach: float,
    radius: float,
) -> None:
    """Add the light's lobe along all paths within `reach` radians of it to the flat image, in place.

    inverse_distance: of the light, 1/pixels, 0 if it is infinitely far.
    """
    bin_size = np.radians(BIN_SIZE_DEG)
    scale = np.sqrt(max((1.0 + light[2]) / 2.0, 1e-6))
    u, v = light[0] / scale / bin_size + size / 2, light[1] / scale / bin_size + size / 2
    # The map stretches away from its centre by at most the square root of two.
    span = reach * 1.5 / bin_size + 1.0
    for row in range(max(0, int(v - span)), min(size, int(v + span) + 1)):
        for column in range(max(0, int(u - span)), min(size, int(u + span) + 1)):
            for k in range(starts[row * size + column], starts[row * size + column + 1]):
                x, y, z = light[0], light[1], light[2]
                if inverse_distance > 0.0:
                    # Direction of a near light from the path's own origin.
                    x, y, z = (
                        x - origins[k, 0] * inverse_distance,
                        y - origins[k, 1] * inverse_distance,
                        z - origins[k, 2] * inverse_distance,
                    )
                    length = np.sqrt(x * x + y * y + z * z)
                    x, y, z = x / length, y / length, z / length
                gap = (x - directions[k, 0]) ** 2 + (y - directions[k, 1]) ** 2 + (z - directions[k, 2]) ** 2
                if gap < reach * reach:
                    # Flat inside the light's disc and soft at its edge.
                    lobe = np.exp(-((np.sqrt(gap) / radius) ** 3))
                    image[pixels[k]] += weights[k] * LIGHT_RADIANCE * lobe
