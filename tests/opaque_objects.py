"""Matte, glossy and metal objects as photographs from formulas: Lambert's law and a microfacet lobe, without glass."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit

SIZE = 120
LIGHT_RADIUS_DEG = 2.2
"""Radius of the light in half vectors."""


@dataclass(frozen=True, slots=True)
class Finish:
    """A surface's finish: its diffuse albedo, its reflectance at normal incidence, and its roughness, the tangent of
    the angle at which the distribution of microfacets (Beckmann and Spizzichino 1963) has fallen to 1/e."""

    albedo: float
    reflectance: float
    roughness: float


FINISHES = {
    "matte": Finish(0.6, 0.0, 0.5),
    "dark matte": Finish(0.1, 0.0, 0.5),
    "eggshell": Finish(0.5, 0.04, 0.4),
    "plastic": Finish(0.5, 0.04, 0.2),
    "semi-gloss": Finish(0.4, 0.04, 0.1),
    "glaze": Finish(0.4, 0.04, 0.03),
    "black glaze": Finish(0.03, 0.04, 0.03),
    "brushed metal": Finish(0.0, 0.8, 0.25),
    "satin metal": Finish(0.0, 0.8, 0.12),
    "polished metal": Finish(0.0, 0.8, 0.04),
    "chrome": Finish(0.0, 0.9, 0.01),
}


def shape(name: str) -> np.ndarray:
    """Normals (SIZE, SIZE, 3) of `sphere`, `vase` (a surface of revolution) or `pebble` (none), NaN outside."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    x, y = (columns - (SIZE - 1) / 2) / (0.46 * SIZE), ((SIZE - 1) / 2 - rows) / (0.46 * SIZE)
    if name == "vase":
        radius = 0.55 + 0.2 * np.cos(2.6 * y + 0.4)
        slope = -0.2 * 2.6 * np.sin(2.6 * y + 0.4)
        side = x / radius
        inside = (np.abs(side) < 1) & (np.abs(y) < 1)
        front = np.sqrt(np.maximum(1 - side**2, 0))
        normals = unit(np.stack([side, -slope, front], axis=-1))
    else:
        bump = 0.0 if name == "sphere" else 1.0
        inside = x**2 + y**2 < 1
        height = np.sqrt(np.maximum(1 - x**2 - y**2, 1e-9))
        # Bumps vanish towards the contour, where the sphere's slope is infinite.
        wave = 0.12 * bump * height
        n = np.stack([x, y, height], axis=-1)
        n[..., 0] += wave * 2.5 * np.cos(5 * x + 2 * y)
        n[..., 1] += wave * 1.0 * np.cos(5 * x + 2 * y)
        normals = unit(n)
    return np.where(inside[..., None], normals, np.nan)


def light_directions(count: int, widest_deg: float, seed: int = 0) -> np.ndarray:
    """Directions (count, 3) spread evenly over a cap, with some disorder."""
    share = (np.arange(count) + 0.5) / count
    z = 1 - share * (1 - np.cos(np.radians(widest_deg)))
    around = np.pi * (3 - np.sqrt(5)) * np.arange(count) + np.random.default_rng(seed).normal(0, 0.2, count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(around), flat * np.sin(around), z], axis=-1)


def photograph(normals: np.ndarray, finish: Finish, lights: np.ndarray, *, seed: int = 0) -> np.ndarray:
    """Photographs (T, H, W) uint8: exposed for half of the range by the diffuse part, or for the lobe to clip."""
    generator = np.random.default_rng(seed)
    inside = np.isfinite(normals[..., 0])
    points = normals[inside]
    # The light's disc, blurred by the lobe: flat inside the disc, the lobe's own flank outside, energy kept.
    area = finish.roughness**2 + np.tan(np.radians(LIGHT_RADIUS_DEG)) ** 2
    levels = []
    for light, half in zip(lights, half_vectors_of(lights), strict=True):
        cosine = np.maximum(points @ light, 0)
        facing = np.arccos(np.clip(points @ half, 1e-3, 1.0))
        beyond = np.tan(np.maximum(facing - np.radians(LIGHT_RADIUS_DEG), 0.0))
        lobe = np.exp(-((beyond / finish.roughness) ** 2)) / (area * np.cos(facing) ** 4)
        fresnel = finish.reflectance + (1 - finish.reflectance) * (1 - half[2]) ** 5
        levels.append(finish.albedo * cosine + fresnel * lobe / 4 * (cosine > 0) / np.maximum(points[:, 2], 0.2))
    stack = np.array(levels)
    # Without a diffuse part worth the name the highlights clip at a third of their height.
    brightest = finish.albedo if finish.albedo > 0.05 else 0.2 * stack.max()
    frames = np.full((len(lights), SIZE, SIZE), 8.0)
    frames[:, inside] += 140.0 / brightest * stack
    frames = np.minimum(frames, 255.0) + generator.normal(0, 1.5, frames.shape)
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)
