"""Depth to a triangle mesh in the camera frame, cut where the surface steps, and its PLY and GLB files."""

from dataclasses import dataclass

import numpy as np
import trimesh

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.integration.edges import edges_of, focal_length

CUT = 1.0
"""Rise between neighbours, in pixels along the normal, that neither of their normals explains: more is a step."""
STEEPEST = 12.0
"""Rise between neighbours, in pixels, beyond which the slope (85 degrees) is a rim's guess and not a surface seen."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A triangle mesh in the camera frame (x right, y up, z to the camera).

    vertices: (N, 3) float32, in the unit of the pixel size or of the perspective depth.
    triangles: (M, 3) int32, counter-clockwise seen from the camera.
    normals: (N, 3) float32, unit, facing the camera.
    confidence: (N,) float32 in 0..1; 1 where none was given.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray


def surface(
    depth: np.ndarray,
    mask: np.ndarray,
    normals: np.ndarray,
    *,
    origin: tuple[int, int] = (0, 0),
    frame: tuple[int, int] | None = None,
    pixel_size: float = 1.0,
    camera: np.ndarray | None = None,
    confidence: np.ndarray | None = None,
    cut: float = CUT,
    steepest: float = STEEPEST,
) -> Surface:
    """Mesh of the depth (H, W) of a region: a vertex per pixel of the mask, triangles between neighbours.

    origin: column and row of the region's top-left pixel in the full frame; frame: width and height of the full frame
    (default: the region is the frame). Orthographic: depth is towards the camera in pixels, and `pixel_size` (mm per
    pixel; 1 leaves pixels) scales all three coordinates; the frame's centre has x = y = 0. With a camera matrix (3, 3;
    pixels of the full frame) depth is the distance from the camera, pixels are projected back and the camera is at the
    origin, looking along -z; `pixel_size` is then left aside.
    Triangles across a step of more than `cut` or steeper than `steepest` (see CUT, STEEPEST) are left out, with the
    vertices that no triangle needs.

    Raises UnusableCapture when no triangle is left, ValueError for shapes that do not agree.
    """
    if not depth.shape == mask.shape == normals.shape[:2]:
        raise ValueError(f"depth {depth.shape}, mask {mask.shape} and normals {normals.shape} do not agree")
    used = np.asarray(mask, bool) & np.isfinite(depth)
    local = None if camera is None else np.array(camera, float) - [[0, 0, origin[0]], [0, 0, origin[1]], [0, 0, 0]]
    triangles = _triangles(used, _kept_edges(depth, used, normals, local, cut, steepest), depth)
    if not len(triangles):
        raise UnusableCapture("the depth holds no triangle", "the mask must be at least two pixels wide somewhere")

    height, width = depth.shape
    if local is None:
        columns, rows = np.meshgrid(np.arange(width) + origin[0], np.arange(height) + origin[1])
        x, y = to_camera(columns, rows, *(frame or (width, height)))
        points = np.stack([x, y, depth], axis=-1) * pixel_size
    else:
        right = (np.arange(width) - local[0, 2]) / local[0, 0]
        down = (np.arange(height)[:, None] - local[1, 2]) / local[1, 1]
        points = np.stack([depth * right, -depth * down, -depth], axis=-1)

    kept, compact = np.unique(triangles, return_inverse=True)
    compact = compact.reshape(-1, 3).astype(np.int32)
    vertices = points.reshape(-1, 3)[kept].astype(np.float32)
    trust = np.ones(len(kept)) if confidence is None else np.nan_to_num(confidence.reshape(-1)[kept])
    return Surface(
        vertices, compact, _vertex_normals(normals.reshape(-1, 3)[kept], vertices, compact), trust.astype(np.float32)
    )


def ply_bytes(surface: Surface) -> bytes:
    """Binary PLY with normals and the vertex property `confidence`."""
    mesh = _mesh(surface)
    mesh.vertex_attributes["confidence"] = surface.confidence
    return bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary", vertex_normal=True))


def glb_bytes(surface: Surface, metres_per_unit: float = 1.0) -> bytes:
    """Binary glTF with normals and the vertex attribute `_confidence`; the format counts in metres."""
    mesh = _mesh(surface)
    mesh.apply_scale(metres_per_unit)
    mesh.vertex_attributes["_confidence"] = surface.confidence
    return bytes(mesh.export(file_type="glb", include_normals=True))


def _mesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.triangles, vertex_normals=surface.normals, process=False)


def _kept_edges(
    depth: np.ndarray, used: np.ndarray, normals: np.ndarray, camera: np.ndarray | None, cut: float, steepest: float
) -> np.ndarray:
    """Which edges (2, H, W; to the next row, to the next column) run along the surface instead of across a step."""
    known = np.isfinite(normals).all(axis=-1)
    edges = edges_of(np.where(known[..., None], normals, 0.0), used, known.astype(float), camera, 0.01)
    height = np.where(used, depth, 1.0).astype(float)
    if camera is not None:
        height = -focal_length(camera) * np.log(height)
    kept = np.zeros(edges.inside.shape, bool)
    for axis in range(2):
        rise = np.roll(height, -1, axis) - height
        here = np.abs(rise - edges.here[axis]) * edges.facing
        there = np.abs(rise - edges.there[axis]) * np.roll(edges.facing, -1, axis)
        unknown = ~known | ~np.roll(known, -1, axis)
        explained = (np.minimum(here, there) <= cut) | unknown
        kept[axis] = edges.inside[axis] & explained & (np.abs(rise) <= steepest)
    return kept


def _triangles(used: np.ndarray, kept: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) of flat pixel numbers: each square of four pixels is split along its flatter diagonal."""
    number = np.arange(used.size).reshape(used.shape)
    here, right = number[:-1, :-1], number[:-1, 1:]
    below, across = number[1:, :-1], number[1:, 1:]
    left, top = kept[0, :-1, :-1], kept[1, :-1, :-1]
    far, bottom = kept[0, :-1, 1:], kept[1, 1:, :-1]
    height = np.where(used, depth, 0.0)
    falling = np.abs(height[:-1, :-1] - height[1:, 1:])
    rising = np.abs(height[:-1, 1:] - height[1:, :-1])
    # A triangle needs the two edges of the square that it holds; a square that lacks an edge has room for one triangle.
    whole = left & top & far & bottom
    flat = whole & (falling <= rising)
    room = ~whole
    pieces = []
    for corners, edges, split in (
        ((here, below, across), left & bottom, flat),
        ((here, across, right), top & far, flat),
        ((here, below, right), left & top, whole & ~flat),
        ((right, below, across), bottom & far, whole & ~flat),
    ):
        alone = room & edges
        room = room & ~alone
        chosen = split | alone
        pieces.append(np.stack([corner[chosen] for corner in corners], axis=-1))
    return np.concatenate(pieces)


def _vertex_normals(normals: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The given normals (N, 3), unit; where one is missing, that of the triangles around the vertex."""
    out = unit(normals.astype(float))
    missing = ~np.isfinite(out).all(axis=-1)
    if missing.any():
        corners = vertices[triangles].astype(float)
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sums = np.zeros(vertices.shape)
        for corner in range(3):
            np.add.at(sums, triangles[:, corner], faces)
        out[missing] = unit(sums)[missing]
    return out.astype(np.float32)
