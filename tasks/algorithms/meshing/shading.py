"""Pictures of a result: N.L shading as in the paper's figures, normals, depth, confidence, and the surface turned.

The drawing libraries are imported where they draw: they are slow to import, and most steps never draw.
"""

import math
from typing import Any

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.meshing.depth_mesh import Surface

_THIRD = 1.0 / math.sqrt(3.0)
LIGHTS = {
    "relit_left": (-_THIRD, _THIRD, _THIRD),
    "relit_front": (0.0, 0.0, 1.0),
    "relit_right": (_THIRD, _THIRD, _THIRD),
}
"""Light directions (camera frame) of the relit pictures: from the upper left, from the camera, from the upper right."""
AMBIENT = 0.15
"""Share of the light that reaches every side of a drawn surface."""


def relit(normals: np.ndarray, mask: np.ndarray, light: tuple[float, float, float]) -> np.ndarray:
    """Lambertian picture (H, W) uint8 of normals (H, W, 3) under a unit light: 255 max(N.L, 0), black outside."""
    shade = np.clip(np.nan_to_num(normals) @ np.asarray(light, float), 0.0, 1.0)
    return np.where(mask, np.rint(255.0 * shade), 0).astype(np.uint8)


def relit_pictures(normals: np.ndarray, mask: np.ndarray) -> dict[str, np.ndarray]:
    """The relit pictures (H, W) uint8 by their names, one for each of LIGHTS."""
    return {name: relit(normals, mask, light) for name, light in LIGHTS.items()}


def normal_picture(normals: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Normals (H, W, 3) as RGB (H, W, 3) uint16: round((n + 1) / 2 * 65535), 0 outside the mask and where NaN."""
    shown = np.asarray(mask, bool) & np.isfinite(normals).all(axis=-1)
    scaled = np.rint((np.clip(np.where(shown[..., None], normals, 0.0), -1.0, 1.0) + 1.0) / 2.0 * 65535.0)
    return np.where(shown[..., None], scaled, 0).astype(np.uint16)


def depth_picture(depth: np.ndarray, unit_name: str = "pixels") -> np.ndarray:
    """Depth (H, W; NaN outside) in colours (h, w, 3) uint8, with a scale in its unit."""
    return _mapped(depth, "viridis", None, f"towards the camera, {unit_name}")


def confidence_picture(confidence: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Confidence (H, W) of 0..1 in colours (h, w, 3) uint8, with its scale."""
    return _mapped(np.where(mask, confidence, np.nan), "magma", (0.0, 1.0), "probability of an error below 5 degrees")


def draw_surface(surface: Surface, azimuth: float = 0.0, elevation: float = 0.0, size: int = 480) -> np.ndarray:
    """Picture (size, size) uint8 of a surface on white, its back sides darker.

    azimuth, elevation: degrees by which the viewer walks to the right and climbs, about the surface's middle; 0, 0 is
    the camera's own view. The viewer is orthographic, and the light comes from over the left shoulder.
    """
    middle = (surface.vertices.min(axis=0) + surface.vertices.max(axis=0)).astype(float) / 2.0
    radius = float(np.linalg.norm(surface.vertices - middle, axis=1).max())
    right, up, back = _viewer(azimuth, elevation)
    steps = (np.arange(size) - (size - 1) / 2.0) * (2.1 * radius / size)
    origins = middle + 2.0 * radius * back + steps[None, :, None] * right - steps[:, None, None] * up
    rays = np.concatenate([origins, np.broadcast_to(-back, origins.shape)], axis=-1).astype(np.float32)

    import open3d as o3d

    tensor: Any = o3d.core.Tensor
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(tensor(surface.vertices), tensor(surface.triangles.astype(np.uint32)))
    answer = scene.cast_rays(tensor(rays), nthreads=1)
    hit = np.isfinite(answer["t_hit"].numpy())
    uv = answer["primitive_uvs"].numpy()[hit].astype(float)
    corners = surface.normals[surface.triangles[answer["primitive_ids"].numpy()[hit]]].astype(float)
    weights = np.stack([1.0 - uv.sum(axis=-1), uv[:, 0], uv[:, 1]], axis=-1)
    normals = unit((corners * weights[..., None]).sum(axis=1))
    light = unit(-0.5 * right + 0.5 * up + back)
    shade = AMBIENT + (1.0 - AMBIENT) * np.clip(np.nan_to_num(normals) @ light, 0.0, 1.0)
    behind = answer["primitive_normals"].numpy()[hit] @ back < 0.0
    picture = np.full((size, size), 255, np.uint8)
    picture[hit] = np.rint(230.0 * np.where(behind, 0.4 * AMBIENT, shade)).astype(np.uint8)
    return picture


def _viewer(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions (3,) to the right, upwards and backwards (to the viewer) in the camera frame."""
    turn, climb = math.radians(azimuth), math.radians(elevation)
    right = np.array([math.cos(turn), 0.0, -math.sin(turn)])
    back = np.array([math.sin(turn) * math.cos(climb), math.sin(climb), math.cos(turn) * math.cos(climb)])
    return right, np.cross(back, right), back


def _mapped(values: np.ndarray, colours: str, limits: tuple[float, float] | None, label: str) -> np.ndarray:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height, width = values.shape
    figure = Figure(figsize=(6.0, max(2.5, 4.6 * height / width)), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    low, high = limits or (None, None)
    picture = axes.imshow(np.ma.masked_invalid(values), cmap=colours, vmin=low, vmax=high, interpolation="nearest")
    axes.set_axis_off()
    figure.colorbar(picture, ax=axes, label=label)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
