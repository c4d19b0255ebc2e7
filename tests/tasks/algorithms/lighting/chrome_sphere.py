"""A chrome sphere drawn with known lights, for the tests of spheres and lights."""

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere


def reflected_directions(sphere: Sphere, shape: tuple[int, int], samples: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction that each of samples x samples points of a pixel reflects; whether it is on the sphere."""
    columns, rows = np.meshgrid(
        (np.arange(shape[1] * samples) + 0.5) / samples - 0.5, (np.arange(shape[0] * samples) + 0.5) / samples - 0.5
    )
    nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    on_sphere = nx**2 + ny**2 < 1.0
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    return np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0], axis=-1), on_sphere


def pooled(image: np.ndarray, samples: int) -> np.ndarray:
    """Return the means of samples x samples points."""
    height, width = image.shape
    return image.reshape(height // samples, samples, width // samples, samples).mean(axis=(1, 3))


def sphere_frame(
    sphere: Sphere,
    lights: list[np.ndarray],
    shape: tuple[int, int],
    *,
    window: bool = False,
    light_radius_deg: float = 8.0,
    noise: float = 1.5,
    seed: int = 0,
) -> np.ndarray:
    """Draw a frame (H, W) uint8 of a sphere under lights that clip; a window is reflected in every frame."""
    directions, on_sphere = reflected_directions(sphere, shape, 5)
    image = np.where(on_sphere, 25.0, 60.0)
    if window:
        pane = ((directions[..., 0] + 0.5) ** 2 < 0.02) & (np.abs(directions[..., 1] - 0.4) < 0.25)
        image += np.where(on_sphere & pane & (directions[..., 2] > 0), 150.0, 0.0)
    for light in lights:
        image += np.where(on_sphere & (directions @ light > np.cos(np.radians(light_radius_deg))), 600.0, 0.0)
    clean = np.minimum(pooled(image, 5), 255.0)
    noisy = clean + np.random.default_rng(seed).normal(0.0, noise, clean.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def light_direction(azimuth: float, polar: float) -> np.ndarray:
    """Return the unit light direction `polar` degrees from the view vector."""
    a, p = np.radians(azimuth), np.radians(polar)
    return np.array([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)])
