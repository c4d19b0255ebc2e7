"""Shadows and caustics that a moving light throws on the table through glass and chrome.

Photons (Arvo 1986: backward ray tracing) start on a grid of a disc that faces the light and hides all solids from it. A
photon that meets a solid leaves the table darker where it would have arrived, and brighter where its paths arrive. Grid
and jitter are the same in all frames, so that nothing flickers but what the light moves.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.stats import qmc

from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.environment import table_places
from glint.tasks.algorithms.simulation.ray_tracing import Paths, Scene

GRID_SIZE = 320
"""Photons along a side of the square around the disc."""
MAP_CELL_PX = 1.5
"""Edge of the cells in which the table gathers photons."""
BLUR_CELLS = 1.5
"""Standard deviation of the blur of what the cells gather, which hides the grid of the photons."""
MAP_REACH = 3.0
"""Distance from the solids, in radii of the ball around them, up to which the table gathers photons."""
MIN_PHOTON_WEIGHT = 0.03
"""Share of a photon's light below which a path of it is abandoned."""
MIN_SHADOW_COSINE = 0.05
"""Least cosine between the light and the table's normal at which shadows are thrown: flatter ones leave the frame."""


@dataclass(frozen=True, slots=True)
class TableLight:
    """What solids change in the light that the camera sees on the table.

    scene: of the solids. table: the plane. shape: (H, W) of the frame.
    places: (2, N) in pixels on the table, right and up, where paths of the camera end; pixels: (N,) int32, theirs;
    weights: (N,) float32, weight of the path times the table's reflectance.
    low: (2,) corner of the table's cells, pixels; cells: their numbers to the right and up.
    centre: (3,) and radius of the ball around all solids, pixels, camera frame.
    disc: (P, 2) photons' places on the disc, in its radii; jitter: (P, 2), deviations of their directions.
    """

    scene: Scene
    table: TablePlane
    shape: tuple[int, int]
    places: np.ndarray
    pixels: np.ndarray
    weights: np.ndarray
    low: np.ndarray
    cells: tuple[int, int]
    centre: np.ndarray
    radius: float
    disc: np.ndarray
    jitter: np.ndarray

    @classmethod
    def prepare(
        cls,
        scene: Scene,
        paths: Paths,
        table: TablePlane,
        reflectance: np.ndarray,
        shape: tuple[int, int],
        light_radius: float,
    ) -> "TableLight":
        """Gather the camera's paths that end on the table, and lay out cells and photons.

        reflectance: (N,) of the table where the paths end on it, 0 elsewhere; shape: (H, W) of the frame; light_radius:
        angular, in radians.
        """
        on_table = reflectance > 0.0
        places, _ = table_places(table, paths.origin[on_table], paths.direction[on_table])
        vertices = np.concatenate([solid.vertices for solid in scene.solids])
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        radius = float(np.linalg.norm(vertices - centre, axis=1).max())
        (right,), (up,) = table_places(table, centre[None], -table.normal[None])[0]
        below = np.array([right, up])
        low = np.maximum(places.min(axis=1), below - MAP_REACH * radius)
        high = np.minimum(places.max(axis=1), below + MAP_REACH * radius)
        columns, rows = np.maximum(np.ceil((high - low) / MAP_CELL_PX), 1).astype(int)
        disc, jitter = _photon_grid(light_radius)
        return cls(
            scene, table, shape, places, paths.pixel[on_table], (paths.weight * reflectance)[on_table], low,
            (int(columns), int(rows)), centre, radius, disc, jitter,
        )  # fmt: skip

    def change(self, light: np.ndarray, distance: float | None) -> np.ndarray:
        """Return the change (H, W) float32 of the light that the camera receives from the table.

        Relative to the light from a white table in the frame's centre under a zenith light. light: (3,), unit, camera
        frame; distance: of the light from the frame's centre in pixels, None: infinite.
        """
        direction = np.asarray(light, np.float64)
        if direction @ self.table.normal < MIN_SHADOW_COSINE:
            return np.zeros(self.shape, np.float32)
        starts, to_light, flux = self._photons(direction, distance)
        missing, *arriving = self.scene.follow(starts, -to_light, 1.0, np.zeros(len(starts)), MIN_PHOTON_WEIGHT)
        met = np.ones(len(starts), bool)
        met[missing[0]] = False
        total = self._gathered(starts[met], -to_light[met], -flux[met])
        for photon, origins, directions, weight, _ in arriving:
            total += self._gathered(origins, directions, flux[photon] * weight)
        irradiance = gaussian_filter(total / MAP_CELL_PX**2, BLUR_CELLS, mode="constant")
        cell = (self.places - self.low[:, None]) / MAP_CELL_PX - 0.5
        illumination = map_coordinates(irradiance, cell, order=1, mode="constant")
        count = self.shape[0] * self.shape[1]
        return np.bincount(self.pixels, self.weights * illumination, count).reshape(self.shape).astype(np.float32)

    def _photons(self, light: np.ndarray, distance: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return starts (P, 3), unit directions to the light (P, 3) and fluxes (P,) of the photons under a light."""
        across = np.cross(light, [0.0, 1.0, 0.0] if abs(light[1]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(across, light)])
        aims = self.centre + self.radius * self.disc @ axes
        to_light = np.tile(light, (len(aims), 1)) if distance is None else light - aims / distance
        # A near light is brighter on its own side, by the inverse square.
        flux = (2.0 * self.radius / GRID_SIZE) ** 2 * (to_light @ light) / np.linalg.norm(to_light, axis=1) ** 3
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        to_light += self.jitter @ axes
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        return aims + 2.0 * self.radius * to_light, to_light, flux

    def _gathered(self, origins: np.ndarray, directions: np.ndarray, flux: np.ndarray) -> np.ndarray:
        """Return the flux (columns, rows) that paths, origins and directions (N, 3), bring to the table's cells."""
        places, on_table = table_places(self.table, origins, directions)
        column, row = np.floor((places - self.low[:, None]) / MAP_CELL_PX).astype(np.int64)
        inside = on_table & (column >= 0) & (column < self.cells[0]) & (row >= 0) & (row < self.cells[1])
        cell = column[inside] * self.cells[1] + row[inside]
        return np.bincount(cell, flux[inside], self.cells[0] * self.cells[1]).reshape(self.cells)


def _photon_grid(light_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places (P, 2) on a disc of radius 1, and deviations (P, 2) of directions within the light's radius."""
    steps = (np.arange(GRID_SIZE) + 0.5) / GRID_SIZE * 2.0 - 1.0
    disc = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    disc = disc[(disc**2).sum(axis=1) < 1.0]
    draw = qmc.Sobol(2, seed=0).random(2 ** int(np.ceil(np.log2(len(disc)))))[: len(disc)]
    angle, turn = light_radius * np.sqrt(draw[:, 0]), 2.0 * np.pi * draw[:, 1]
    return disc, angle[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
