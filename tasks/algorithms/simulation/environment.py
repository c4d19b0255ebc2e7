"""What stands round the object: a dim room with windows, and a textured plane behind it."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

TEXTURE = 512
"""Edge of the background's texture in texels; one texel is a pixel."""


@dataclass(frozen=True, slots=True)
class Room:
    """texture (N, N): reflectances of the plane at z = `plane`; windows (M, 4): direction and half width in radians."""

    texture: np.ndarray
    plane: float
    windows: np.ndarray
    ambient: float = 0.02
    bright: float = 0.25

    @classmethod
    def furnished(cls, plane: float, generator: np.random.Generator) -> "Room":
        """A room with three windows before the object."""
        noise = generator.normal(size=(TEXTURE, TEXTURE))
        streaks = gaussian_filter(noise, (3, 18), mode="wrap") * 30.0 + gaussian_filter(noise, 5, mode="wrap") * 6.0
        texture = np.clip(0.35 + 0.2 * streaks, 0.08, 0.7)
        windows = []
        for centre in (0.6, 2.4, 4.6):
            around, polar = centre + generator.uniform(-0.4, 0.4), generator.uniform(0.9, 1.4)
            flat, half = np.sin(polar), generator.uniform(0.12, 0.22)
            windows.append([flat * np.cos(around), flat * np.sin(around), np.cos(polar), half])
        return cls(texture.astype(np.float32), plane, np.array(windows))

    def radiance(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What paths (N, 3) from origins (N, 3) arrive at: light (N,) of the room, and reflectance (N,) of the plane
        where they meet it (0 elsewhere), which the lamp lights up too."""
        down = directions[:, 2] < -0.05
        reach = np.where(down, (self.plane - origins[:, 2]) / np.where(down, directions[:, 2], -1.0), 0.0)
        place = origins + directions * reach[:, None]
        texel = np.stack([-place[:, 1], place[:, 0]]) + TEXTURE / 2
        seen = map_coordinates(self.texture, texel, order=1, mode="grid-wrap")
        reflectance = np.where(down & (np.abs(place[:, :2]).max(axis=1) < 4000), seen, 0.0)
        light = np.where(down, self.ambient * 1.6 * reflectance, self.ambient * (0.35 + 0.3 * directions[:, 1]))
        for x, y, z, half in self.windows:
            cosine = directions @ np.array([x, y, z])
            right = np.cross([0.0, 1.0, 0.0], [x, y, z])
            right /= np.linalg.norm(right)
            up = np.cross([x, y, z], right)
            across, along = directions @ right, directions @ up
            pane = (cosine > 0) & (np.abs(across) < half) & (np.abs(along) < 1.2 * half)
            bar = (np.abs(across) < 0.06 * half) | (np.abs(along) < 0.06 * half)
            light = np.where(pane & ~bar, self.bright, light)
        return light.astype(np.float32), reflectance.astype(np.float32)
