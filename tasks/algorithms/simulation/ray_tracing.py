"""Light paths of a static scene, traced once: where each of a pixel's rays leaves it, and with what weight.

Camera and object do not move and the lamp is far away, so a frame is a weighted sum over the paths whose exit
direction lies near the lamp (METHOD, "Simulating a capture physically").
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d

from glint.tasks.algorithms.simulation.solids import CHROME, GLASS, MATTE, Solid

INDEX = 1.5
"""Refractive index of the glass."""
BOUNCES = 9
LEAST = 0.004
"""Weight below which a path is followed no further."""
MIRROR = 0.9
"""Reflectance of chrome."""
FAR = 1e4
"""Pixels before the object at which parallel rays start."""
NUDGE = 2e-3
"""Pixels by which a path starts off the surface that it leaves."""


@dataclass(frozen=True, slots=True)
class Paths:
    """Paths out of the scene: pixel (N,) int32 of the frame, origin (N, 3) of the last surface, direction (N, 3) unit,
    weight (N,); `depth` bounces before. matte (H, W): weight of diffuse surfaces seen, their normals' z averaged in."""

    pixel: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    bounces: np.ndarray
    matte: np.ndarray


@dataclass(frozen=True, slots=True)
class Truth:
    """What the camera sees first of the outer glass: normals (H, W, 3) towards the camera, depth (H, W) in pixels; NaN
    where the pixel's centre misses it."""

    normals: np.ndarray
    depth: np.ndarray


class Scene:
    """Solids that rays can meet."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.solids = list(solids)
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        tensor: Any = o3d.core.Tensor
        for solid in self.solids:
            vertices, triangles = solid.vertices.astype(np.float32), solid.triangles.astype(np.uint32)
            self._scene.add_triangles(tensor(vertices), tensor(triangles))
        self._materials = np.array([solid.material for solid in self.solids])

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance (N,), inf where nothing is met; number of the solid (N,); its outward normal there (N, 3)."""
        rays = np.concatenate([origins, directions], axis=1).astype(np.float32)
        tensor: Any = o3d.core.Tensor
        found = self._scene.cast_rays(tensor(rays))
        distance = found["t_hit"].numpy().astype(np.float64)
        hit = np.isfinite(distance)
        which = np.where(hit, found["geometry_ids"].numpy(), 0).astype(np.int64)
        triangle, uv = found["primitive_ids"].numpy().astype(np.int64), found["primitive_uvs"].numpy()
        normals = np.zeros((len(origins), 3))
        for number, solid in enumerate(self.solids):
            here = hit & (which == number)
            corner = solid.vertex_normals[solid.triangles[triangle[here]]]
            weights = np.column_stack([1.0 - uv[here].sum(axis=1), uv[here]])
            normals[here] = np.einsum("nkc,nk->nc", corner, weights)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return distance, which, normals

    def truth(self, columns: np.ndarray, rows: np.ndarray, away: float | None = None) -> Truth:
        """What rays through x = columns, y = rows of the plane z = 0 (H, W each, camera frame) meet of the outer glass
        first: along -z, or from a camera at z = `away`."""
        origins, directions = _rays(columns.ravel().astype(np.float64), rows.ravel().astype(np.float64), away)
        distance, which, normals = self.cast(origins, directions)
        seen = np.isfinite(distance) & (self._materials[which] == GLASS)
        for number, solid in enumerate(self.solids):
            here = seen & (which == number)
            if solid.field is not None and here.any():
                triangle = np.zeros(int(here.sum()), np.int64)
                points = origins[here] + directions[here] * distance[here, None]
                normals[here] = solid.normals(points, triangle, np.zeros((len(triangle), 2)))
        normals = np.where((normals * directions).sum(axis=1, keepdims=True) > 0, -normals, normals)
        depth = origins[:, 2] + directions[:, 2] * np.where(seen, distance, 0.0)
        return Truth(
            np.where(seen[:, None], normals, np.nan).reshape(*columns.shape, 3).astype(np.float32),
            np.where(seen, depth, np.nan).reshape(columns.shape).astype(np.float32),
        )

    def trace(
        self,
        columns: np.ndarray,
        rows: np.ndarray,
        rays: int,
        generator: np.random.Generator,
        away: float | None = None,
    ) -> Paths:
        """Follow rays x rays jittered rays of each pixel through the scene; columns, rows, away as in `truth`."""
        height, width = columns.shape
        cells = (np.arange(rays) + 0.5) / rays - 0.5
        parts: list[tuple[np.ndarray, ...]] = []
        matte = np.zeros(columns.size)
        for down in cells:
            for right in cells:
                jitter = generator.uniform(-0.5 / rays, 0.5 / rays, (2, columns.size))
                x, y = columns.ravel() + right + jitter[0], rows.ravel() + down + jitter[1]
                parts += self._follow(*_rays(x, y, away), 1.0 / rays**2, matte)
        merged = [np.concatenate(each) for each in zip(*parts, strict=True)]
        pixel, origin, direction, weight, bounces = merged
        return Paths(
            pixel.astype(np.int32),
            origin.astype(np.float32),
            direction.astype(np.float32),
            weight.astype(np.float32),
            bounces.astype(np.int8),
            matte.reshape(height, width),
        )

    def _follow(
        self, origins: np.ndarray, directions: np.ndarray, share: float, matte: np.ndarray
    ) -> list[tuple[np.ndarray, ...]]:
        pixel, weight = np.arange(len(origins)), np.full(len(origins), share)
        left: list[tuple[np.ndarray, ...]] = []
        for bounce in range(BOUNCES):
            distance, which, normals = self.cast(origins, directions)
            met = np.isfinite(distance)
            out = ~met
            left.append((pixel[out], origins[out], directions[out], weight[out], np.full(int(out.sum()), bounce)))
            origins, directions, pixel, weight = origins[met], directions[met], pixel[met], weight[met]
            normals, material = normals[met], self._materials[which[met]]
            origins = origins + directions * distance[met, None]
            dull = material == MATTE
            np.add.at(matte, pixel[dull], weight[dull])
            glass, chrome = material == GLASS, material == CHROME
            mirrored = _mirrored(directions, normals)
            bent, reflectance = refraction(directions, normals)
            kept = [
                (chrome, mirrored, weight * MIRROR),
                (glass, mirrored, weight * reflectance),
                (glass & (reflectance < 1.0), bent, weight * (1.0 - reflectance)),
            ]
            choices = [(where & (of >= LEAST * share), to, of) for where, to, of in kept]
            pixel = np.concatenate([pixel[where] for where, _, _ in choices])
            origins = np.concatenate([origins[where] + NUDGE * to[where] for where, to, _ in choices])
            weight = np.concatenate([of[where] for where, _, of in choices])
            directions = np.concatenate([to[where] for where, to, _ in choices])
            if len(pixel) == 0:
                break
        return left


def _rays(x: np.ndarray, y: np.ndarray, away: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (N, 3) of the camera's rays through (x, y, 0)."""
    if away is None:
        return np.stack([x, y, np.full(len(x), FAR)], axis=1), np.tile([0.0, 0.0, -1.0], (len(x), 1))
    directions = np.stack([x, y, np.full(len(x), -away)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.tile([0.0, 0.0, away], (len(x), 1)), directions


def refraction(directions: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Refracted directions (N, 3) and Fresnel reflectances (N,), 1 at total reflection.

    normals (N, 3) point out of the glass; a direction against its normal enters it.
    """
    entering = (directions * normals).sum(axis=1) < 0
    facing = np.where(entering[:, None], normals, -normals)
    cosine = np.clip(-(facing * directions).sum(axis=1), 0.0, 1.0)
    ratio = np.where(entering, 1.0 / INDEX, INDEX)
    square = 1.0 - ratio**2 * (1.0 - cosine**2)
    total = square < 0
    beyond = np.sqrt(np.maximum(square, 0.0))
    first, second = np.where(entering, 1.0, INDEX), np.where(entering, INDEX, 1.0)
    across = (first * cosine - second * beyond) / (first * cosine + second * beyond + 1e-12)
    along = (first * beyond - second * cosine) / (first * beyond + second * cosine + 1e-12)
    bent = ratio[:, None] * directions + (ratio * cosine - beyond)[:, None] * facing
    bent /= np.maximum(np.linalg.norm(bent, axis=1, keepdims=True), 1e-12)
    return bent, np.where(total, 1.0, 0.5 * (across**2 + along**2))


def _mirrored(directions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return directions - 2.0 * (directions * normals).sum(axis=1, keepdims=True) * normals
