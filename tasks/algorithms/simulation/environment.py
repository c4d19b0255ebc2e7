"""Surroundings of a simulated object: a dim room with windows, and a textured table below or behind the object.

Synthetic, by choice and not after a publication: static light that shows through the glass and must not be taken for
highlights (section 4.2 of the paper discards weak intensities).
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from glint.tasks.algorithms.near_light.table_plane import TablePlane

TEXTURE_SIZE_PX = 512
"""Edge of the background's texture in texels; one texel is a pixel."""
PLANE_EXTENT_PX = 4000
"""Half width of the textured table; beyond it the plane is black."""


@dataclass(frozen=True, slots=True)
class Environment:
    """Static surroundings in the camera frame.

    texture: (N, N) float32 in 0..1, reflectances of the table, repeated.
    table: its plane, relative to the frame's centre.
    windows: (M, 4), unit direction and angular half width in radians of each window.
    ambient, bright: radiance of the room and of the windows relative to white.
    """

    texture: np.ndarray
    table: TablePlane
    windows: np.ndarray
    ambient: float = 0.02
    bright: float = 0.25

    @classmethod
    def random(cls, table: TablePlane, generator: np.random.Generator, contrast: float = 1.0) -> "Environment":
        """Return a room with three windows in front of the object and a random texture on the table.

        contrast: of the texture, as a factor; 0 is a plain table.
        """
        noise = generator.normal(size=(TEXTURE_SIZE_PX, TEXTURE_SIZE_PX))
        streaks = gaussian_filter(noise, (3, 18), mode="wrap") * 30.0 + gaussian_filter(noise, 5, mode="wrap") * 6.0
        texture = np.clip(0.35 + 0.2 * contrast * streaks, 0.08, 0.7)
        windows = []
        # Windows stand above the table: their directions turn with its normal.
        cosine, sine = table.normal[2], table.normal[1]
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
        for centre in (0.6, 2.4, 4.6):
            azimuth, polar = centre + generator.uniform(-0.4, 0.4), generator.uniform(0.9, 1.4)
            flat, half_width = np.sin(polar), generator.uniform(0.12, 0.22)
            direction = turn @ np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(polar)])
            windows.append([*direction, half_width])
        return cls(texture.astype(np.float32), table, np.array(windows))

    def radiance(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what paths that leave the object arrive at.

        origins (N, 3) in pixels, directions (N, 3) unit, camera frame -> static radiance (N,) float32, and reflectance
        (N,) float32 of the table where they meet it (0 elsewhere), which the moving light illuminates too.
        """
        place, down = table_places(self.table, origins, directions)
        texel = np.stack([-place[1], place[0]]) + TEXTURE_SIZE_PX / 2
        sampled = map_coordinates(self.texture, texel, order=1, mode="grid-wrap")
        reflectance = np.where(down & (np.abs(place).max(axis=0) < PLANE_EXTENT_PX), sampled, 0.0)
        light = np.where(down, self.ambient * 1.6 * reflectance, self.ambient * (0.35 + 0.3 * directions[:, 1]))
        for x, y, z, half_width in self.windows:
            # Horizontal and vertical position in the window's own plane, where crossed bars divide the pane.
            cosine = directions @ np.array([x, y, z])
            level = np.cross([0.0, 1.0, 0.0], [x, y, z])
            level /= np.linalg.norm(level)
            up = np.cross([x, y, z], level)
            across, along = directions @ level, directions @ up
            pane = (cosine > 0) & (np.abs(across) < half_width) & (np.abs(along) < 1.2 * half_width)
            bar = (np.abs(across) < 0.06 * half_width) | (np.abs(along) < 0.06 * half_width)
            light = np.where(pane & ~bar, self.bright, light)
        return light.astype(np.float32), reflectance.astype(np.float32)


def table_places(table: TablePlane, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where paths meet the table, and which of them do.

    origins (N, 3) in pixels, directions (N, 3) unit, camera frame -> places (2, N) on the table in pixels, to the right
    and up, and (N,) bool; of other paths the place is that of their origin.
    """
    normal, right = table.normal.astype(directions.dtype), np.array([1.0, 0.0, 0.0], directions.dtype)
    sinking = directions @ normal
    # Nearly parallel paths would meet the plane too far out.
    down = sinking < -0.05
    reach = np.where(down, (table.offset - origins @ normal) / np.where(down, sinking, -1.0), 0.0)
    position = origins + directions * reach[:, None]
    return np.stack([position @ right, position @ np.cross(normal, right)]), down
