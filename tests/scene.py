"""A glass half ellipsoid beside mirror balls, drawn from formulas alone: truth that owes nothing to the ray tracer.

A pixel of the object is bright where the frame's half vector lies within the lamp's disc about its normal (a true
highlight), or about a smooth field of other directions (a false one, on part of the object only).
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from glint.storage.catalogue.loading import Capture, Catalogue, Object, Region, write
from glint.storage.catalogue.loading import Sphere as Entry
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere
from tests.storage.footage.videos import write_video
from tests.tasks.algorithms.lighting.chrome_sphere import pooled, reflected_directions

HEIGHT, WIDTH = 120, 168
REGION = Region(x=20, y=30, width=64, height=56)
SEMI_AXES = np.array([27.0, 23.0, 21.0])
"""Of the ellipsoid in pixels: x, y, towards the camera."""
BALLS = (Sphere(124.3, 38.6, 22.0), Sphere(130.8, 91.2, 21.0))
DISC = 2.2
"""Degrees of half vector from the lamp's centre to its edge."""


@dataclass(frozen=True, slots=True)
class Scene:
    """The catalogue's file; truth: normals (56, 64, 3) and depth (56, 64) of the region, lights (T, 3); false (H, W, 3)
    where the other side's highlights point, NaN where there are none; mask (56, 64)."""

    catalogue: Path
    normals: np.ndarray
    depth: np.ndarray
    false: np.ndarray
    lights: np.ndarray
    mask: np.ndarray


def draw_scene(folder: Path, *, frames: int = 500, balls: int = 1, seed: int = 0, noise: float = 1.5) -> Scene:
    """Draw the video `ellipsoid/front` with mask, truth and catalogue; takes about two seconds."""
    generator = np.random.default_rng(seed)
    normals, depth, mask = ellipsoid()
    false = false_directions(normals, mask)
    lights = spiral(frames)
    half_vectors = half_vectors_of(lights)
    texture = cv2.GaussianBlur(generator.normal(0, 1, (HEIGHT, WIDTH)).astype(np.float32), (0, 0), 2)
    ground = np.clip(70 + 12 * texture / texture.std(), 35, 110)
    spheres = [(slice(int(ball.y) - 26, int(ball.y) + 27), slice(int(ball.x) - 26, int(ball.x) + 27)) for ball in BALLS]
    mirrors = [
        reflected_directions(ball.in_crop(columns.start, rows.start), (53, 53), 4)
        for ball, (rows, columns) in zip(BALLS, spheres, strict=True)
    ]
    film = []
    for light, half_vector in zip(lights, half_vectors, strict=True):
        picture = ground.copy()
        for place, (mirrored, on) in list(zip(spheres, mirrors, strict=True))[:balls]:
            picture[place] = np.where(pooled(on, 4) > 0.5, 25.0, picture[place])
            picture[place] += pooled(np.where(on & (mirrored @ light > np.cos(np.radians(2 * DISC))), 400.0, 0.0), 4)
        for field in (normals, false):
            near = np.nan_to_num(field @ half_vector) > np.cos(np.radians(DISC))
            picture[REGION.rows, REGION.columns][near] = 300.0
        noisy = np.clip(picture, 0, 255) + generator.normal(0, noise, picture.shape)
        film.append(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    video = write_video(folder / "front.mp4", film, options={"crf": "14", "preset": "veryfast"})
    cv2.imwrite(str(folder / "mask.png"), np.where(mask, 255, 0).astype(np.uint8))
    truth = folder / "truth"
    truth.mkdir(exist_ok=True)
    for name, values in (("normals", normals), ("depth", depth), ("lights", lights)):
        np.save(truth / f"{name}.npy", values.astype(np.float32))
    capture = Capture(
        id="front",
        frames=str(video),
        spheres=tuple(Entry(x=ball.x, y=ball.y, radius=ball.radius) for ball in BALLS[:balls]),
        region=REGION,
        mask=str(folder / "mask.png"),
        truth=str(truth),
    )
    entry = Object(id="ellipsoid", captures=(capture,))
    catalogue = Catalogue.model_validate({"schema": 1, "name": "scene", "objects": (entry,)})
    write(catalogue, folder / "catalogue.yaml")
    return Scene(folder / "catalogue.yaml", normals, depth, false, lights, mask)


def ellipsoid() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals (H, W, 3) and depth (H, W) of the upper half of the ellipsoid, NaN outside, and its mask."""
    rows, columns = np.mgrid[: REGION.height, : REGION.width]
    x, y = columns - (REGION.width - 1) / 2, (REGION.height - 1) / 2 - rows
    inside = 1.0 - (x / SEMI_AXES[0]) ** 2 - (y / SEMI_AXES[1]) ** 2
    mask = inside > 0.0
    z = SEMI_AXES[2] * np.sqrt(np.where(mask, inside, np.nan))
    return unit(np.stack([x, y, z], axis=-1) / SEMI_AXES**2), z, mask


def false_directions(normals: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Where highlights from the far side point (H, W, 3): nearly the counter normals, bent; NaN on the left third."""
    columns = np.arange(REGION.width)[None, :, None]
    bent = np.concatenate(
        [-0.8 * normals[..., :1] + 0.1 * np.sin(columns / 9.0), -0.9 * normals[..., 1:2] - 0.05, normals[..., 2:]],
        axis=-1,
    )
    return np.where((mask & (columns[..., 0] > REGION.width / 3))[..., None], unit(bent), np.nan)


def spiral(frames: int, turns: float = 13.0, widest: float = 84.0) -> np.ndarray:
    """Light directions (T, 3) that wind outwards from the view axis to `widest` degrees, at an even pace."""
    share = np.sqrt((np.arange(frames) + 0.5) / frames)
    polar, azimuth = np.radians(widest) * share, 2 * np.pi * turns * share
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
