"""Frames of a mirror sphere before a flat table, under a round lamp that wanders over the hemisphere, ray by ray."""

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere

SIZE_PX, RAYS = 120, 4
"""Side of the frames, and square root of the rays of a pixel."""
LAMP_RADIUS_DEG, LAMP_LEVEL, TABLE_LEVEL, SPHERE_LEVEL = 9.0, 250.0, 120.0, 60.0


def lamps(count: int, reach_deg: float = 80.0) -> np.ndarray:
    """Directions (count, 3) spread evenly over the cap of the hemisphere within `reach_deg` of the view."""
    z = 1.0 - (1.0 - np.cos(np.radians(reach_deg))) * (np.arange(count) + 0.5) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    sine = np.sqrt(1.0 - z**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=1)


def mirrored_lamp(
    sphere: Sphere,
    directions: np.ndarray,
    *,
    width_ratio: float = 1.0,
    upward: np.ndarray | tuple[float, float, float] = (0.0, 1.0, 0.0),
) -> np.ndarray:
    """Frames (T, H, W) uint8 under lamps (T, 3).

    width_ratio: width over height of the lamp; upward: direction, (3,) or (T, 3), towards which its height points.
    """
    offsets = (np.arange(RAYS * SIZE_PX) + 0.5) / RAYS - 0.5
    nx, ny = (offsets[None, :] - sphere.x) / sphere.radius, (sphere.y - offsets[:, None]) / sphere.radius
    nx, ny = np.broadcast_arrays(nx, ny)
    inside = np.hypot(nx, ny) < 1.0
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    reflected = np.stack([2.0 * nz * nx, 2.0 * nz * ny, 2.0 * nz**2 - 1.0], axis=-1)
    noise = np.random.default_rng(0).normal(0.0, 1.0, (len(directions), SIZE_PX, SIZE_PX))
    frames = []
    for direction, across, grain in zip(directions, np.cross(np.asarray(upward), directions), noise, strict=True):
        across = across / np.linalg.norm(across)
        up = np.cross(direction, across)
        radius = np.sin(np.radians(LAMP_RADIUS_DEG))
        lit = np.hypot(reflected @ across / width_ratio, reflected @ up) < radius
        lit &= reflected @ direction > 0.0
        levels = np.where(inside, np.where(lit, LAMP_LEVEL, SPHERE_LEVEL), TABLE_LEVEL * (0.6 + 0.4 * direction[2]))
        frames.append(levels.reshape(SIZE_PX, RAYS, SIZE_PX, RAYS).mean(axis=(1, 3)) + grain)
    return np.asarray(np.clip(np.round(frames), 0, 255), np.uint8)
