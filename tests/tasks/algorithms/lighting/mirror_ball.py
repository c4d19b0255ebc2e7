"""A mirror ball drawn with a known lamp, for the tests of spheres and lights."""

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere


def directions(sphere: Sphere, shape: tuple[int, int], fine: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Directions that each of fine x fine samples of a pixel mirrors, and whether the sample is on the ball."""
    steps = (np.arange(shape[1] * fine) + 0.5) / fine - 0.5, (np.arange(shape[0] * fine) + 0.5) / fine - 0.5
    columns, rows = np.meshgrid(*steps)
    nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    on = nx**2 + ny**2 < 1.0
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    return np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0], axis=-1), on


def pooled(picture: np.ndarray, fine: int) -> np.ndarray:
    """Means of fine x fine samples."""
    height, width = picture.shape
    return picture.reshape(height // fine, fine, width // fine, fine).mean(axis=(1, 3))


def ball_frame(
    sphere: Sphere,
    lamps: list[np.ndarray],
    shape: tuple[int, int],
    *,
    window: bool = False,
    extent: float = 8.0,
    noise: float = 1.5,
    seed: int = 0,
) -> np.ndarray:
    """Frame (H, W) uint8 of the ball under clipping lamps of `extent` degrees radius; a window mirrors statically."""
    mirrored, on = directions(sphere, shape, 5)
    picture = np.where(on, 25.0, 60.0)
    if window:
        towards = (mirrored[..., 0] + 0.5) ** 2 < 0.02
        picture += np.where(on & towards & (np.abs(mirrored[..., 1] - 0.4) < 0.25) & (mirrored[..., 2] > 0), 150.0, 0.0)
    for lamp in lamps:
        picture += np.where(on & (mirrored @ lamp > np.cos(np.radians(extent))), 600.0, 0.0)
    clean = np.minimum(pooled(picture, 5), 255.0)
    noisy = clean + np.random.default_rng(seed).normal(0.0, noise, clean.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def lamp(azimuth: float, polar: float) -> np.ndarray:
    """Unit light direction `polar` degrees from the view vector."""
    a, p = np.radians(azimuth), np.radians(polar)
    return np.array([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)])
