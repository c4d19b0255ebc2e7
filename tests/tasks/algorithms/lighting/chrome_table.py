"""Frames of chrome spheres on a table that they mirror, drawn exactly under an orthographic camera."""

from dataclasses import dataclass, field

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.spheres import Sphere

SAMPLES = 3
"""Points per pixel along either side."""
LAMP_DEG = 3.0
"""Angular radius of the light."""


@dataclass(frozen=True)
class Scene:
    """spheres: on a table; tilt_deg: of the view from the table's normal; texture: the table's relative contrast;
    check: side in pixels of a checkerboard on it, 0: none; blur: standard deviation in pixels; reflectance: of the
    chrome."""

    spheres: list[Sphere] = field(default_factory=list)
    tilt_deg: float = 10.0
    shape: tuple[int, int] = (220, 300)
    frames: int = 24
    texture: float = 0.15
    check: int = 0
    blur: float = 0.7
    reflectance: float = 0.75
    seed: int = 0


def light_directions(count: int, tilt_deg: float) -> np.ndarray:
    """Return lights (T, 3) on a spiral about the table's normal."""
    turn = np.arange(count) * 2.4
    polar = np.radians(10.0 + 55.0 * np.sqrt((np.arange(count) + 0.5) / count))
    local = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    tilt = np.radians(tilt_deg)
    rotation = np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]])
    return local @ rotation.T


def render(scene: Scene) -> np.ndarray:
    """Draw the frames (T, H, W) uint8: the table with shadows, and the spheres with table, room and light in them."""
    generator = np.random.default_rng(scene.seed)
    up = np.array([0.0, np.sin(np.radians(scene.tilt_deg)), np.cos(np.radians(scene.tilt_deg))])
    height, width = scene.shape
    pattern = cv2.GaussianBlur(generator.normal(0, 1, (3 * height, 3 * width)).astype(np.float32), (0, 0), 4.0)
    albedo = 1.0 + scene.texture * pattern / pattern.std()
    if scene.check:
        across, down = np.meshgrid(np.arange(3 * width) // scene.check, np.arange(3 * height) // scene.check)
        albedo *= np.where((across + down) % 2 == 0, 1.25, 0.5)
    columns, rows = np.meshgrid(
        (np.arange(width * SAMPLES) + 0.5) / SAMPLES - 0.5, (np.arange(height * SAMPLES) + 0.5) / SAMPLES - 0.5
    )
    x, y = columns.ravel(), -rows.ravel()
    points = np.stack([x, y, -(up[0] * x + up[1] * y) / up[2]], axis=1)
    centres = [_centre(sphere, up) for sphere in scene.spheres]
    owner, mirrored, hits, sees_table = np.full(len(x), -1), np.zeros((len(x), 3)), points.copy(), np.ones(len(x), bool)
    for number, (sphere, centre) in enumerate(zip(scene.spheres, centres, strict=True)):
        u, v = (x - centre[0]) / sphere.radius, (y - centre[1]) / sphere.radius
        on = u**2 + v**2 < 1.0
        w = np.sqrt(1.0 - u[on] ** 2 - v[on] ** 2)
        normal = np.stack([u[on], v[on], w], axis=1)
        direction = 2.0 * w[:, None] * normal - np.array([0.0, 0.0, 1.0])
        start = centre + sphere.radius * normal
        fall = direction @ up
        distance = -(start @ up) / np.where(fall < -1e-3, fall, -1e-3)
        owner[on], mirrored[on] = number, direction
        hits[on], sees_table[on] = start + distance[:, None] * direction, fall < -0.02
    on_sphere = owner >= 0
    table = _lookup(albedo, hits, scene.shape)
    frames = []
    for light in light_directions(scene.frames, scene.tilt_deg):
        lit = np.full(len(x), max(float(light @ up), 0.0))
        for sphere, centre in zip(scene.spheres, centres, strict=True):
            offset = centre - hits
            along = offset @ light
            lit[(along > 0) & ((offset**2).sum(axis=1) - along**2 < sphere.radius**2)] = 0.0
        level = np.where(sees_table, table * (30.0 + 110.0 * lit), 25.0) * np.where(on_sphere, scene.reflectance, 1.0)
        level[on_sphere & (mirrored @ light > np.cos(np.radians(LAMP_DEG)))] = 900.0
        picture = level.reshape(height, SAMPLES, width, SAMPLES).mean(axis=(1, 3))
        picture = cv2.GaussianBlur(np.minimum(picture, 600.0), (0, 0), scene.blur) + generator.normal(0, 1, scene.shape)
        frames.append(np.clip(np.rint(picture), 0, 255).astype(np.uint8))
    return np.stack(frames)


def glossy_sphere(frames: np.ndarray, sphere: Sphere, tilt_deg: float = 10.0) -> np.ndarray:
    """Return frames with a glossy sphere drawn over them: lit by Lambert's law, with a highlight."""
    rows, columns = np.mgrid[: frames.shape[1], : frames.shape[2]]
    u, v = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    on = u**2 + v**2 < 1.0
    normal = np.stack([u[on], v[on], np.sqrt(1.0 - u[on] ** 2 - v[on] ** 2)], axis=1)
    drawn = frames.copy()
    for frame, light in zip(drawn, light_directions(len(frames), tilt_deg), strict=True):
        level = 15.0 + 120.0 * np.maximum(normal @ light, 0.0)
        level[normal @ half_vectors_of(light[None])[0] > np.cos(np.radians(0.8 * LAMP_DEG))] = 255.0
        frame[on] = np.clip(level, 0, 255).astype(np.uint8)
    return drawn


def assert_near(found: Sphere, truth: Sphere, share: float = 0.01) -> None:
    """Assert that a circle's centre and radius are those of the true one, within a share of its radius."""
    error = max(abs(found.x - truth.x), abs(found.y - truth.y), abs(found.radius - truth.radius))
    assert error <= share * truth.radius, (found, truth)


def _centre(sphere: Sphere, up: np.ndarray) -> np.ndarray:
    """Return the centre of a sphere that lies on the table and is seen at its place in the image."""
    x, y = sphere.x, -sphere.y
    return np.array([x, y, (sphere.radius - up[0] * x - up[1] * y) / up[2]])


def _lookup(albedo: np.ndarray, points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the table's albedo at points (N, 3), by the pixel that they are seen at; beyond the table its mean."""
    columns = (points[:, 0] + shape[1]).astype(np.float32).reshape(-1, 100)
    rows = (-points[:, 1] + shape[0]).astype(np.float32).reshape(-1, 100)
    return cv2.remap(albedo, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT).ravel()
