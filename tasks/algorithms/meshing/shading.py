"""Shaded images of a result: Lambertian N.L of the normals, as in the paper's Figure 8, and the mesh from any side."""

import math

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.meshing.depth_mesh import Surface
from glint.tasks.algorithms.meshing.ray_casting import RayScene, interpolated

_THIRD = 1.0 / math.sqrt(3.0)
RELIGHT_DIRECTIONS = {
    "relit_left": (-_THIRD, _THIRD, _THIRD),
    "relit_front": (0.0, 0.0, 1.0),
    "relit_right": (_THIRD, _THIRD, _THIRD),
}
"""Unit light directions (camera frame) of the relit images: from the upper left, the camera, the upper right."""
AMBIENT_SHARE = 0.15
"""Share of the light that reaches all sides of a drawn surface."""
FIELD_RADII = 2.1
"""Width of the drawn field of view, in radii of the surface's bounding sphere."""


def relit(normals: np.ndarray, mask: np.ndarray, light: tuple[float, float, float]) -> np.ndarray:
    """Shade normals (H, W, 3) under a unit light (3,): (H, W) uint8, 255 max(N.L, 0), black outside the mask (H, W)."""
    shade = np.clip(np.nan_to_num(normals) @ np.asarray(light, float), 0.0, 1.0)
    return np.where(mask, np.rint(255.0 * shade), 0).astype(np.uint8)


def relit_pictures(normals: np.ndarray, mask: np.ndarray) -> dict[str, np.ndarray]:
    """Return images (H, W) uint8 of normals (H, W, 3) in a mask, by name: relit from each of RELIGHT_DIRECTIONS."""
    return {name: relit(normals, mask, light) for name, light in RELIGHT_DIRECTIONS.items()}


def draw_surface(surface: Surface, azimuth: float = 0.0, elevation: float = 0.0, size: int = 480) -> np.ndarray:
    """Render a surface on white, its back sides darker: (size, size) uint8.

    The viewer is orthographic; the light comes from above the viewer's left shoulder.

    Args:
        surface: the mesh, in the camera frame.
        azimuth, elevation: degrees by which the viewer moves to the right and up about the middle of the surface; 0, 0
            is the camera's own view.
        size: edge of the image in pixels.
    """
    middle = (surface.vertices.min(axis=0) + surface.vertices.max(axis=0)).astype(float) / 2.0
    radius = float(np.linalg.norm(surface.vertices - middle, axis=1).max())
    right, up, back = _viewer_axes(azimuth, elevation)
    steps = (np.arange(size) - (size - 1) / 2.0) * (FIELD_RADII * radius / size)
    origins = middle + 2.0 * radius * back + steps[None, :, None] * right - steps[:, None, None] * up
    hits = RayScene((surface.vertices, surface.triangles)).cast(origins, np.broadcast_to(-back, origins.shape))
    hit = hits.is_hit
    # Normals are interpolated over the triangles (Phong shading).
    normals = unit(interpolated(surface.normals.astype(float), surface.triangles, hits.triangle[hit], hits.uv[hit]))
    light = unit(-0.5 * right + 0.5 * up + back)
    shade = AMBIENT_SHARE + (1.0 - AMBIENT_SHARE) * np.clip(np.nan_to_num(normals) @ light, 0.0, 1.0)
    behind = hits.facet_normals[hit] @ back < 0.0
    image = np.full((size, size), 255, np.uint8)
    image[hit] = np.rint(230.0 * np.where(behind, 0.4 * AMBIENT_SHARE, shade)).astype(np.uint8)
    return image


def _viewer_axes(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the viewer's right, up and back (towards the viewer) directions (3,) in the camera frame."""
    turn, climb = math.radians(azimuth), math.radians(elevation)
    right = np.array([math.cos(turn), 0.0, -math.sin(turn)])
    back = np.array([math.sin(turn) * math.cos(climb), math.sin(climb), math.cos(turn) * math.cos(climb)])
    return right, np.cross(back, right), back
