"""Solids of revolution with flat ends, a beaker, tumblers, bowls and a vase, rendered from formulas."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.revolution.opening import Opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

SHAPE = (200, 140)


def camera_positions() -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (H, W) of the pixels in the camera frame."""
    rows, columns = np.indices(SHAPE).astype(float)
    return to_camera(columns, rows, SHAPE[1], SHAPE[0])


def beaker_profile() -> tuple[np.ndarray, np.ndarray]:
    """Return radii and heights (N,)."""
    heights = np.arange(-75.0, 76.0, 0.5)
    radii = 40.0 + 0.1 * heights
    radii[[0, -1]] = 0.0
    return radii, heights


def beaker_surface(tilt: float) -> SurfaceOfRevolution:
    """Return the beaker at a tilt in degrees."""
    return upright_surface(*beaker_profile(), tilt)


def tumbler(tilt: float, half_height: float, radius: float) -> SurfaceOfRevolution:
    """Return a tumbler at a tilt in degrees; radius: in pixels, at half its height."""
    heights = np.arange(-half_height, half_height + 0.5, 0.5)
    radii = radius + heights / 8.0
    radii[[0, -1]] = 0.0
    return upright_surface(radii, heights, tilt)


def bowl_on_stem(tilt: float) -> SurfaceOfRevolution:
    """Return a conical bowl on a stem with a flat foot, at a tilt in degrees."""
    heights = np.arange(-75.0, 76.0, 0.5)
    radii = np.select([heights < -70.0, heights < 5.0], [30.0, 4.0], np.clip(4.0 + 1.1 * (heights - 5.0), 4.0, 45.0))
    radii[[0, -1]] = 0.0
    return upright_surface(radii, heights, tilt)


def flared_vase(tilt: float) -> SurfaceOfRevolution:
    """Return a vase with a waist under a flared rim, at a tilt in degrees."""
    heights = np.arange(-75.0, 76.0, 0.5)
    radii = np.interp(heights, (-75.0, -10.0, 45.0, 75.0), (24.0, 46.0, 20.0, 31.0))
    radii[[0, -1]] = 0.0
    return upright_surface(radii, heights, tilt)


def shallow_bowl(tilt: float) -> SurfaceOfRevolution:
    """Return the body that fills a bowl of 60 pixels radius, steepest at its rim, at a tilt in degrees."""
    heights = np.arange(-30.0, 0.6, 0.5)
    radii = 60.0 * np.sqrt(np.clip(1.0 + heights / 30.0, 0.0, 1.0))
    radii[[0, -1]] = 0.0
    return upright_surface(radii, heights, tilt)


def seen_bowl(tilt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3) and depths (H, W) of a bowl, of its inside where that is seen, NaN beside it."""
    x, y = camera_positions()
    normals, depths, _ = Opening(shallow_bowl(tilt), 0.0, np.ones(SHAPE, bool)).entries(x.ravel(), y.ravel())
    return normals.reshape(*SHAPE, 3), depths.reshape(SHAPE)


def upright_surface(radii: np.ndarray, heights: np.ndarray, tilt: float) -> SurfaceOfRevolution:
    """Return the surface of a profile (N,) about the image's vertical, at a tilt in degrees."""
    axis = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)
    return SurfaceOfRevolution(axis, np.radians(tilt), heights, radii**2, np.gradient(radii**2, heights) / 2.0)


def beaker_normals(tilt: float, far: bool = False) -> np.ndarray:
    """Return the normals (H, W, 3) of the beaker at a tilt in degrees, NaN beside it; far: of the wall's inner side."""
    return seen_normals(beaker_surface(tilt), far)


def seen_normals(surface: SurfaceOfRevolution, far: bool = False) -> np.ndarray:
    """Return the normals (H, W, 3) of a surface, NaN beside it; far: of its wall's inner side."""
    x, y = camera_positions()
    return surface.normals(x.ravel(), y.ravel(), far).reshape(*SHAPE, 3)


def turned(deviation: np.ndarray, tilt: float) -> np.ndarray:
    """Return the beaker's normals (H, W, 3), its wall's turned by (H, W, 2) radians round the axis and along it."""
    surface, normals = beaker_surface(tilt), beaker_normals(tilt)
    x, y = (values.ravel() for values in camera_positions())
    outward = unit(surface.intersect(x, y).outward).reshape(*SHAPE, 3)
    along = np.cross(surface.frame.upward, outward)
    is_wall = np.abs(normals @ surface.frame.upward) < 0.5
    moved = normals + np.tan(deviation[..., :1]) * along + np.tan(deviation[..., 1:]) * surface.frame.upward
    return np.where(is_wall[..., None], unit(moved), normals)


def cylindrical(tilt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return azimuth and height (H, W) of the beaker's points at a tilt in degrees."""
    surface = beaker_surface(tilt)
    x, y = (values.ravel() for values in camera_positions())
    hits = surface.intersect(x, y)
    forward = np.cross([1.0, 0.0, 0.0], surface.frame.upward)
    return np.arctan2(hits.outward[:, 0], hits.outward @ forward).reshape(SHAPE), hits.heights.reshape(SHAPE)


def false_sheets(count: int) -> np.ndarray:
    """Return smooth sheets (K, H, W, 3) that have nothing to do with any surface."""
    x, y = camera_positions()
    phases = 2.0 * np.pi * np.arange(count) / count
    return np.stack(
        [unit(np.dstack([0.6 * np.sin(x / 30 + k), 0.5 * np.cos(y / 25 + k), np.ones(SHAPE)])) for k in phases]
    )


def observable(normals: np.ndarray) -> np.ndarray:
    """Return the normals (H, W, 3) that highlights can show: those within 40 degrees of the view axis; else NaN."""
    return np.where(normals[..., 2:] > np.cos(np.radians(40.0)), normals, np.nan)
