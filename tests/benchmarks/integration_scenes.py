"""Surfaces of known height with depth discontinuities, and their normals, for measurements of the integration.

Heights are in pixels. Each scene is drawn at any size, under an orthographic camera or a perspective one three sizes
radii, with normals turned at random by a given angle.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

CAMERA_DISTANCE = 3.0
"""Distance of the perspective camera in sizes of the picture: a view angle of 19 degrees."""
STEP_PX = 0.5
"""Distance in pixels along the normal, beyond what the normals at both ends allow, from which an edge is a step."""

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True)
class Scene:
    """Normals (H, W, 3) in the camera frame, mask (H, W), camera (3, 3) or None, and the truth.

    height: (H, W), towards the camera in pixels, or under perspective the distance from the camera in pixels.
    piece: (H, W) bool, the largest part without a step across it; the offsets of other parts are unknowable.
    steps: rectangles (rows, column left of the step) in which a step's height is measured.
    """

    normals: np.ndarray
    mask: np.ndarray
    camera: np.ndarray | None
    height: np.ndarray
    piece: np.ndarray
    steps: tuple[tuple[slice, int], ...] = ()


def with_noise(scene: Scene, degrees: float, seed: int = 0) -> Scene:
    """Turn each normal at random, by `degrees` root mean square about each of two axes."""
    generator = np.random.default_rng(seed)
    noisy = scene.normals + np.radians(degrees) * generator.normal(size=scene.normals.shape)
    noisy /= np.linalg.norm(noisy, axis=-1, keepdims=True)
    noisy[..., 2] = np.maximum(noisy[..., 2], 0.0) if scene.camera is None else noisy[..., 2]
    return Scene(noisy, scene.mask, scene.camera, scene.height, scene.piece, scene.steps)


def pleats(size: int, depth: float, count: int = 2) -> Scene:
    """Draw a cloth whose waves lean over towards the top until they hide a part of it (orthographic)."""
    samples = np.linspace(-0.1, 1.1, 12 * size)
    height, normals = np.full((size, size), -np.inf), np.zeros((size, size, 3))
    columns = np.arange(size) / size
    wave = 2 * np.pi * count
    for row in range(size):
        lean, growth = 1.6 * depth * (1 - row / size), -1.6 * depth
        x = samples + lean * np.sin(wave * samples) * depth
        z = depth * np.cos(wave * samples)
        x_u, z_u = 1 + lean * depth * wave * np.cos(wave * samples), -depth * wave * np.sin(wave * samples)
        # Rows run downwards: a step of one row down is -1 / size in y.
        x_v = growth * depth * np.sin(wave * samples)
        across = np.stack([x_u, np.zeros_like(x), z_u], axis=-1)
        down = np.stack([x_v, -np.ones_like(x), np.zeros_like(x)], axis=-1)
        normal = np.cross(down, across)
        # The highest of all segments of the profile above each pixel is visible.
        start = np.minimum(x[:-1], x[1:])
        stop = np.maximum(x[:-1], x[1:])
        first, last = np.ceil(start * size).astype(int), np.floor(stop * size).astype(int)
        for k in np.flatnonzero((last >= first) & (last >= 0) & (first < size)):
            for column in range(max(first[k], 0), min(last[k], size - 1) + 1):
                share = (columns[column] - x[k]) / (x[k + 1] - x[k])
                value = z[k] + share * (z[k + 1] - z[k])
                if value > height[row, column]:
                    height[row, column] = value
                    normals[row, column] = normal[k] + share * (normal[k + 1] - normal[k])
    normals *= np.sign(normals[..., 2:] + 1e-12)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    return _finished(normals, np.isfinite(height), None, height * size)


def traced(field: Field, size: int, perspective: bool = False) -> Scene:
    """Trace rays to the zero of a signed distance field of points (N, 3), which fills the cube from -0.5 to 0.5."""
    rows, columns = np.indices((size, size))
    x, y = (columns - (size - 1) / 2) / size, ((size - 1) / 2 - rows) / size
    if perspective:
        directions = np.stack([x, y, np.full_like(x, -CAMERA_DISTANCE)], axis=-1) / CAMERA_DISTANCE
        origins = np.broadcast_to([0.0, 0.0, CAMERA_DISTANCE], directions.shape)
    else:
        directions = np.broadcast_to([0.0, 0.0, -1.0], (size, size, 3))
        origins = np.stack([x, y, np.full_like(x, CAMERA_DISTANCE)], axis=-1)
    lengths = np.linalg.norm(directions, axis=-1)
    along = np.full((size, size), CAMERA_DISTANCE - 1.0)
    for _ in range(300):
        points = origins + along[..., None] * directions
        # Three quarters of the distance, as unions and cuts of solids only bound it.
        along += 0.75 * field(points.reshape(-1, 3)).reshape(size, size) / lengths
        along = np.minimum(along, CAMERA_DISTANCE + 1.5)
    points = (origins + along[..., None] * directions).reshape(-1, 3)
    hit = np.abs(field(points)).reshape(size, size) < 1e-4
    shifts = 1e-5 * np.eye(3)
    normals = np.stack([field(points + shift) - field(points - shift) for shift in shifts], axis=-1)
    normals = (normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)).reshape(size, size, 3)
    hit &= (normals * directions).sum(axis=-1) < 0
    centre = (size - 1) / 2
    focal = CAMERA_DISTANCE * size
    camera = np.array([[focal, 0, centre], [0, focal, centre], [0, 0, 1.0]]) if perspective else None
    value = along * size if perspective else (CAMERA_DISTANCE - along) * size
    return _finished(normals, hit, camera, value)


def _finished(normals: np.ndarray, mask: np.ndarray, camera: np.ndarray | None, height: np.ndarray) -> Scene:
    """Keep the largest connected part of the mask, and find its largest part without a step across it."""
    mask = _largest(ndimage.label(mask)[0])
    size = len(mask)
    height = np.where(mask, height, 0.0)
    focal = None if camera is None else camera[0, 0]
    level = height if focal is None else -focal * np.log(np.where(mask, height, 1.0))
    if camera is None:
        cosine, ratio = normals[..., 2], np.stack([normals[..., 1], -normals[..., 0]])
    else:
        rows, columns = np.indices((size, size))
        rays = np.stack(
            [(columns - camera[0, 2]) / focal, (camera[1, 2] - rows) / focal, -np.ones((size, size))], axis=-1
        )
        cosine, ratio = -(normals * rays).sum(axis=-1), np.stack([normals[..., 1], -normals[..., 0]])
    cosine = np.maximum(cosine, 0.02)
    slope = ratio / cosine
    # Sides of pixels that a step does not cut are joined on a grid of twice the size.
    joined = np.zeros((2 * size, 2 * size), bool)
    joined[::2, ::2] = mask
    for axis, (di, dj) in enumerate(((1, 0), (0, 1))):
        rise = np.roll(level, -1, axis) - level
        ends = slope[axis], np.roll(slope[axis], -1, axis)
        outside = np.maximum(np.minimum(*ends) - rise, rise - np.maximum(*ends))
        outside *= np.maximum(cosine, np.roll(cosine, -1, axis))
        joined[di::2, dj::2] = (outside < STEP_PX) & mask & np.roll(mask, -1, axis)
    joined[-1], joined[:, -1] = False, False
    piece = _largest(ndimage.label(joined)[0])[::2, ::2]
    return Scene(np.where(mask[..., None], normals, np.nan), mask, camera, height, piece)


def _largest(labels: np.ndarray) -> np.ndarray:
    counts = np.bincount(labels.ravel())
    counts[0] = 0
    return labels == counts.argmax()


def _sphere(centre: tuple[float, float, float], radius: float) -> Field:
    return lambda points: np.linalg.norm(points - np.array(centre), axis=-1) - radius


def _capsule(start: tuple[float, float, float], end: tuple[float, float, float], radius: float) -> Field:
    first, axis = np.array(start), np.array(end) - np.array(start)

    def distance(points: np.ndarray) -> np.ndarray:
        share = np.clip((points - first) @ axis / (axis @ axis), 0.0, 1.0)
        return np.linalg.norm(points - first - share[:, None] * axis, axis=-1) - radius

    return distance


def _torus(centre: tuple[float, float, float], axis: tuple[float, float, float], ring: float, tube: float) -> Field:
    direction = np.array(axis) / np.linalg.norm(axis)

    def distance(points: np.ndarray) -> np.ndarray:
        offset = points - np.array(centre)
        along = offset @ direction
        across = np.linalg.norm(offset - along[:, None] * direction, axis=-1)
        return np.hypot(across - ring, along) - tube

    return distance


def _union(*fields: Field) -> Field:
    return lambda points: np.minimum.reduce([field(points) for field in fields])


def _bowl(radius: float, wall: float, turn: float) -> Field:
    """Return half a hollow sphere, opening upwards and turned towards the camera by `turn` degrees."""
    up = np.array([0.0, np.cos(np.radians(turn)), np.sin(np.radians(turn))])

    def distance(points: np.ndarray) -> np.ndarray:
        centred = points - np.array([0.0, 0.12, 0.0])
        radii = np.linalg.norm(centred, axis=-1)
        return np.maximum(np.maximum(radii - radius, radius - wall - radii), centred @ up)

    return distance


def _box(centre: tuple[float, float, float], half: tuple[float, float, float], turn: float) -> Field:
    """Return a box turned by `turn` degrees about x and y."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])

    def distance(points: np.ndarray) -> np.ndarray:
        excess = np.abs((points - np.array(centre)) @ rotation) - np.array(half)
        return np.linalg.norm(np.maximum(excess, 0.0), axis=-1) + np.minimum(excess.max(axis=-1), 0.0)

    return distance


def _staircase(about_x: float, about_y: float, count: int = 4) -> Field:
    """Return a staircase with treads and risers, turned by degrees."""
    (c, s), (e, t) = ((np.cos(angle), np.sin(angle)) for angle in np.radians((about_x, about_y)))
    rotation = np.array([[e, 0, t], [0, 1, 0], [-t, 0, e]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    heights = [(k + 1) * 0.25 / count for k in range(count)]
    depths = [0.275 - k * 0.25 / count for k in range(count)]
    boxes = [_box((0.0, -0.27 + y, -0.3 + z), (0.22, y, z), 0.0) for y, z in zip(heights, depths, strict=True)]
    return lambda points: _union(*boxes)(points @ rotation)


FIELDS: dict[str, Field] = {
    "ball": _sphere((0.0, 0.0, 0.0), 0.42),
    "arm": _union(_sphere((0.0, 0.05, -0.1), 0.38), _capsule((0.0, 0.28, 0.1), (-0.12, -0.25, 0.42), 0.06)),
    "tusk": _union(
        _capsule((0.0, 0.3, -0.2), (0.0, -0.3, -0.2), 0.2), _capsule((-0.1, 0.2, -0.1), (0.25, -0.2, 0.3), 0.05)
    ),
    "head": _union(_sphere((0.0, -0.15, -0.2), 0.3), _sphere((0.03, 0.1, 0.1), 0.2)),
    "handle": _union(_sphere((-0.05, 0.0, -0.1), 0.34), _torus((0.12, 0.0, 0.22), (0.8, 0.0, -0.6), 0.2, 0.045)),
    "bowl": _bowl(0.42, 0.06, 35.0),
    "cup": _bowl(0.42, 0.03, 15.0),
    "boxes": _union(_box((-0.1, -0.05, -0.2), (0.25, 0.3, 0.1), 25.0), _box((0.1, 0.1, 0.05), (0.16, 0.1, 0.2), 20.0)),
    "staircase": _staircase(35.0, 25.0),
    "limbs": _union(
        _capsule((-0.25, 0.3, -0.2), (-0.2, -0.35, 0.0), 0.09),
        _capsule((-0.25, 0.3, -0.2), (0.3, -0.1, 0.25), 0.09),
        _capsule((0.3, 0.3, -0.2), (-0.05, -0.35, 0.1), 0.09),
        _capsule((-0.25, 0.3, -0.2), (0.3, 0.3, -0.2), 0.1),
    ),
}
"""Solids: round ones, limbs before bodies, hollow ones and ones with edges."""
