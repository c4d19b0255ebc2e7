"""Light paths of a static scene, traced once: how each of a pixel's rays leaves the scene, and with what weight.

Whitted-style recursive ray tracing (Whitted 1980) with Fresnel weights, unpolarised, at dielectric surfaces. Camera and
object do not move and the light is distant, so a frame is a weighted sum over the paths whose exit direction lies near
the light (`renderer`); paths need to be traced only once for all frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.meshing.ray_casting import RayScene
from glint.tasks.algorithms.simulation.solids import CHROME, GLASS, MATTE, Solid

REFRACTIVE_INDEX = 1.5
"""Refractive index of the glass, relative to air."""
MAX_BOUNCES = 9
"""Most surfaces that a path meets."""
MIN_PATH_WEIGHT = 0.004
"""Weight, as a share of the ray's, below which a path is abandoned."""
CHROME_REFLECTANCE = 0.9
"""Share of the light that a chrome sphere reflects."""
RAY_START_PX = 1e4
"""Height z in pixels at which parallel rays start."""
SURFACE_OFFSET_PX = 2e-3
"""Distance by which a path starts off the surface that it leaves, so that it does not meet it again."""


@dataclass(frozen=True, slots=True)
class Paths:
    """Paths that leave the scene, camera frame, pixels.

    pixel: (N,) int32, flat number of the pixel that a path contributes to.
    origin: (N, 3) float32, point on the last surface.
    direction: (N, 3) float32, unit, direction of exit.
    weight: (N,) float32; the weights of a pixel's paths add up to at most 1.
    bounces: (N,) int8, surfaces met before.
    matte: (H, W) float64, weight that ends on diffuse surfaces.
    """

    pixel: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    bounces: np.ndarray
    matte: np.ndarray


@dataclass(frozen=True, slots=True)
class RenderedTruth:
    """First intersection of each pixel's central ray with the outer glass.

    normals: (H, W, 3) float32, unit, camera frame, facing the camera; depth: (H, W) float32, z in pixels. NaN where the
    ray misses.
    """

    normals: np.ndarray
    depth: np.ndarray


class Scene:
    """Solids that rays can meet."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.solids = list(solids)
        self._scene = RayScene(*((solid.vertices, solid.triangles) for solid in self.solids))
        self._materials = np.array([solid.material for solid in self.solids])

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cast rays from origins (N, 3) in unit directions (N, 3).

        Returns:
            Distance (N,) float64, inf where a ray meets nothing; number of the solid (N,) int64, 0 there; the solid's
            outward normal (N, 3) float64, interpolated over its mesh, 0 there.
        """
        hits = self._scene.cast(origins, directions)
        distance, hit = hits.distance.astype(np.float64), hits.is_hit
        numbers = np.where(hit, hits.mesh, 0).astype(np.int64)
        triangle, uv = hits.triangle.astype(np.int64), hits.uv
        normals = np.zeros((len(origins), 3))
        for number, solid in enumerate(self.solids):
            chosen = hit & (numbers == number)
            corner = solid.vertex_normals[solid.triangles[triangle[chosen]]]
            weights = np.column_stack([1.0 - uv[chosen].sum(axis=1), uv[chosen]])
            normals[chosen] = np.einsum("nkc,nk->nc", corner, weights)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return distance, numbers, normals

    def truth(self, columns: np.ndarray, rows: np.ndarray, camera_distance: float | None = None) -> RenderedTruth:
        """Return what each pixel's central ray meets first of the outer glass.

        columns, rows: (H, W) camera-frame x and y in pixels of the points of the plane z = 0 that the rays run through,
        along -z or, with `camera_distance`, from a camera at z = `camera_distance`.
        """
        x, y = columns.ravel().astype(np.float64), rows.ravel().astype(np.float64)
        origins, directions = _camera_rays(x, y, camera_distance)
        distance, numbers, normals = self.cast(origins, directions)
        observed = np.isfinite(distance) & (self._materials[numbers] == GLASS)
        # Interpolated normals are good enough for rendering; the truth takes exact ones where there are any.
        for number, solid in enumerate(self.solids):
            chosen = observed & (numbers == number)
            exact = solid.exact_normals(origins[chosen] + directions[chosen] * distance[chosen, None])
            if exact is not None:
                normals[chosen] = exact
        normals = np.where((normals * directions).sum(axis=1, keepdims=True) > 0, -normals, normals)
        depth = origins[:, 2] + directions[:, 2] * np.where(observed, distance, 0.0)
        return RenderedTruth(
            np.where(observed[:, None], normals, np.nan).reshape(*columns.shape, 3).astype(np.float32),
            np.where(observed, depth, np.nan).reshape(columns.shape).astype(np.float32),
        )

    def trace(
        self,
        columns: np.ndarray,
        rows: np.ndarray,
        rays: int,
        generator: np.random.Generator,
        camera_distance: float | None = None,
    ) -> Paths:
        """Trace rays x rays jittered rays of each pixel (stratified sampling) through the scene.

        columns, rows, camera_distance: see `truth`.
        """
        height, width = columns.shape
        cells = (np.arange(rays) + 0.5) / rays - 0.5
        parts: list[tuple[np.ndarray, ...]] = []
        matte = np.zeros(columns.size)
        for down in cells:
            for right in cells:
                jitter = generator.uniform(-0.5 / rays, 0.5 / rays, (2, columns.size))
                x, y = columns.ravel() + right + jitter[0], rows.ravel() + down + jitter[1]
                parts += self.follow(*_camera_rays(x, y, camera_distance), 1.0 / rays**2, matte)
        pixel, origin, direction, weight, bounces = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return Paths(
            pixel.astype(np.int32),
            origin.astype(np.float32),
            direction.astype(np.float32),
            weight.astype(np.float32),
            bounces.astype(np.int8),
            matte.reshape(height, width),
        )

    def follow(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        share: float,
        matte: np.ndarray,
        min_weight: float = MIN_PATH_WEIGHT,
    ) -> list[tuple[np.ndarray, ...]]:
        """Follow one ray of weight `share` per pixel through all reflections and refractions.

        Args:
            origins: (N, 3) in pixels; directions: (N, 3), unit, camera frame.
            share: weight of a ray; min_weight: share of it below which a path is abandoned.
            matte: (N,), to which the weight that ends on matte surfaces is added.

        Returns:
            The paths that leave the scene, by bounce, as tuples of pixel, origin, direction, weight and bounces.
        """
        pixel, weight = np.arange(len(origins)), np.full(len(origins), share)
        escaped: list[tuple[np.ndarray, ...]] = []
        for bounce in range(MAX_BOUNCES):
            distance, numbers, normals = self.cast(origins, directions)
            hit = np.isfinite(distance)
            out = ~hit
            escaped.append((pixel[out], origins[out], directions[out], weight[out], np.full(int(out.sum()), bounce)))
            origins, directions, pixel, weight = origins[hit], directions[hit], pixel[hit], weight[hit]
            normals, material = normals[hit], self._materials[numbers[hit]]
            origins = origins + directions * distance[hit, None]
            diffuse = material == MATTE
            np.add.at(matte, pixel[diffuse], weight[diffuse])
            # At glass a path splits into its reflection and its refraction, unless that is negligible.
            glass, chrome = material == GLASS, material == CHROME
            reflected = _reflected(directions, normals)
            refracted, reflectance = refraction(directions, normals)
            branches = [
                (chrome, reflected, weight * CHROME_REFLECTANCE),
                (glass, reflected, weight * reflectance),
                (glass & (reflectance < 1.0), refracted, weight * (1.0 - reflectance)),
            ]
            kept = [
                (chosen & (branch_weight >= min_weight * share), direction, branch_weight)
                for chosen, direction, branch_weight in branches
            ]
            pixel = np.concatenate([pixel[chosen] for chosen, _, _ in kept])
            origins = np.concatenate(
                [origins[chosen] + SURFACE_OFFSET_PX * direction[chosen] for chosen, direction, _ in kept]
            )
            weight = np.concatenate([branch_weight[chosen] for chosen, _, branch_weight in kept])
            directions = np.concatenate([direction[chosen] for chosen, direction, _ in kept])
            if len(pixel) == 0:
                break
        return escaped


def _camera_rays(x: np.ndarray, y: np.ndarray, camera_distance: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and unit directions (N, 3) of the camera's rays through (x, y, 0)."""
    if camera_distance is None:
        return np.stack([x, y, np.full(len(x), RAY_START_PX)], axis=1), np.tile([0.0, 0.0, -1.0], (len(x), 1))
    directions = np.stack([x, y, np.full(len(x), -camera_distance)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.tile([0.0, 0.0, camera_distance], (len(x), 1)), directions


def refraction(directions: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Refract unit directions (N, 3) at a glass surface, by Snell's law and the Fresnel equations.

    normals (N, 3), unit, point out of the glass; a direction against its normal enters it.

    Returns:
        Refracted unit directions (N, 3), and reflectances (N,) for unpolarised light, 1 at total internal reflection
        (where the direction is meaningless).
    """
    entering = (directions * normals).sum(axis=1) < 0
    # The normal on the side that the light comes from.
    incident_normals = np.where(entering[:, None], normals, -normals)
    cosine = np.clip(-(incident_normals * directions).sum(axis=1), 0.0, 1.0)
    ratio = np.where(entering, 1.0 / REFRACTIVE_INDEX, REFRACTIVE_INDEX)
    # Square of the cosine beyond the surface; negative at total internal reflection.
    square = 1.0 - ratio**2 * (1.0 - cosine**2)
    total = square < 0
    transmitted = np.sqrt(np.maximum(square, 0.0))
    first, second = np.where(entering, 1.0, REFRACTIVE_INDEX), np.where(entering, REFRACTIVE_INDEX, 1.0)
    s_polarised = (first * cosine - second * transmitted) / (first * cosine + second * transmitted + 1e-12)
    p_polarised = (first * transmitted - second * cosine) / (first * transmitted + second * cosine + 1e-12)
    refracted = ratio[:, None] * directions + (ratio * cosine - transmitted)[:, None] * incident_normals
    refracted /= np.maximum(np.linalg.norm(refracted, axis=1, keepdims=True), 1e-12)
    return refracted, np.where(total, 1.0, 0.5 * (s_polarised**2 + p_polarised**2))


def _reflected(directions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return directions (N, 3) mirrored at surfaces of unit normals (N, 3)."""
    return directions - 2.0 * (directions * normals).sum(axis=1, keepdims=True) * normals
