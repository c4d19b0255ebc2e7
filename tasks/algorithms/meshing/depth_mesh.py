"""Triangulate a depth map in the camera frame, cut where the surface steps, and write it as PLY and GLB.

A range image becomes a mesh by joining neighbouring pixels unless they lie across a depth discontinuity (after Turk and
Levoy, Zippered Polygon Meshes from Range Images, SIGGRAPH 1994). Here an edge is a discontinuity if the normals at
both ends fail to explain the rise along it, as in bilateral integration (`integration.edges`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import CAMERA_FLIP, camera_in_crop, focal_length
from glint.tasks.algorithms.geometry.triangles import triangle_vectors
from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.integration.contour_margin import CONTOUR_MARGIN_PX, MIN_COSINE, Contour, contour_of
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.meshing.contour_vertices import boundary_vertices, moves_to_contour

MAX_STEP_PX = 1.0
"""Difference between rise and prediction, in pixels along the normal, up to which an edge lies on the surface."""
METRES_PER_MM = 0.001
VERTEX_BUFFER, INDEX_BUFFER = 34962, 34963
"""Targets of buffer views (glTF 2.0, section 5.11.5), so that viewers need not infer them."""
MATERIAL = PBRMaterial(
    name="glass", baseColorFactor=[200, 212, 219, 255], metallicFactor=0.0, roughnessFactor=0.4, doubleSided=True
)
"""Opaque, since viewers draw transparent meshes without the depth that they are here for. Seen from both sides: the
surface of one view has no back."""
MAX_SLOPE = 12.0
"""Rise in pixels per pixel beyond which a slope (85 degrees) is no surface, unless the margin can be so steep."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A triangle mesh in the camera frame (x right, y up, z to the camera).

    vertices: (N, 3) float32, in the unit of the pixel size or of the perspective depth.
    triangles: (M, 3) int32, counter-clockwise as viewed from the camera.
    normals: (N, 3) float32, unit, facing the camera.
    confidence: (N,) float32 in 0..1; 1 where none was given.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray


def mesh_from_depth(
    depth: np.ndarray,
    mask: np.ndarray,
    normals: np.ndarray,
    *,
    origin: tuple[int, int] = (0, 0),
    frame: tuple[int, int] | None = None,
    pixel_size: float = 1.0,
    camera: np.ndarray | None = None,
    confidence: np.ndarray | None = None,
    max_step: float = MAX_STEP_PX,
    max_slope: float = MAX_SLOPE,
) -> Surface:
    """Triangulate the depth of a region: a vertex per pixel of the mask, triangles between neighbours.

    The outermost vertices lie on the contour (`contour_vertices`), all others at centres of pixels. Triangles across a
    step or a slope that is too steep are left out, with the vertices that no triangle needs.

    Args:
        depth: (H, W), NaN where unknown. Orthographic: height towards the camera in pixels. With a camera matrix:
            distance from the camera along its axis, in any unit.
        mask: (H, W) bool.
        normals: (H, W, 3) unit, camera frame, NaN where unknown.
        origin: column and row of the region's top-left pixel in the full frame.
        frame: width and height of the full frame; by default the region is the frame.
        pixel_size: unit per pixel (1 leaves pixels), which scales all three coordinates of an orthographic depth; the
            frame's centre has x = y = 0. Ignored with a camera matrix.
        camera: (3, 3) intrinsic matrix in pixels of the full frame. Pixels are projected back; the camera is at the
            origin and looks along -z.
        confidence: (H, W) in 0..1.
        max_step, max_slope: see MAX_STEP_PX and MAX_SLOPE.

    Raises:
        UnusableCapture: no triangle is left.
        ValueError: shapes do not agree.
    """
    if not depth.shape == mask.shape == normals.shape[:2]:
        raise ValueError(f"depth {depth.shape}, mask {mask.shape} and normals {normals.shape} do not agree")
    used = np.asarray(mask, bool) & np.isfinite(depth)
    local = None if camera is None else camera_in_crop(camera, *origin)
    height, contour = _height(depth, used, local), contour_of(used)
    triangles = _triangles(used, _surface_edges(height, used, contour, normals, local, max_step, max_slope), depth)
    if not len(triangles):
        raise UnusableCapture("the depth holds no triangle", "the mask must be at least two pixels wide somewhere")

    # Renumber the vertices that triangles use.
    kept, compact = np.unique(triangles, return_inverse=True)
    compact = compact.reshape(-1, 3).astype(np.int32)
    rows, columns = (index.astype(float) for index in np.divmod(kept, depth.shape[1]))
    distance = depth.reshape(-1)[kept].astype(float)
    boundary = boundary_vertices(compact)
    right, down, closer = moves_to_contour(height, used, contour, kept[boundary])
    columns[boundary] += right
    rows[boundary] += down
    if local is None:
        distance[boundary] += closer
        x, y = to_camera(columns + origin[0], rows + origin[1], *(frame or depth.shape[::-1]))
        points = np.stack([x, y, distance], axis=-1) * pixel_size
    else:
        distance[boundary] *= np.exp(-closer / focal_length(local))
        rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(local).T
        points = distance[:, None] * rays * CAMERA_FLIP
    vertices = points.astype(np.float32)
    vertex_normals = _vertex_normals(normals.reshape(-1, 3)[kept], vertices, compact)
    vertex_confidence = np.ones(len(kept)) if confidence is None else np.nan_to_num(confidence.reshape(-1)[kept])
    return Surface(vertices, compact, vertex_normals, vertex_confidence.astype(np.float32))


def ply_bytes(surface: Surface) -> bytes:
    """Encode as binary PLY with normals and the vertex property `confidence`."""
    mesh = _trimesh(surface)
    mesh.vertex_attributes["confidence"] = surface.confidence
    return bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary", vertex_normal=True))


def glb_bytes(surface: Surface, unit: str) -> bytes:
    """Encode as binary glTF with normals, the vertex attribute `_confidence` and a material seen from both sides.

    unit: of the surface. "mm" is written as metres, the unit of glTF; any other is left as it is, and the file's asset
    says that its scale is unknown.
    """
    mesh = _trimesh(surface)
    is_scaled = unit == "mm"
    if is_scaled:
        mesh.apply_scale(METRES_PER_MM)
    mesh.vertex_attributes["_confidence"] = surface.confidence
    mesh.visual = TextureVisuals(material=MATERIAL)
    facts = {"unit": "m" if is_scaled else unit, "scale": "known" if is_scaled else "unknown"}

    def complete(tree: dict[str, Any]) -> None:
        tree["asset"] |= {"generator": "Glint", "extras": facts}
        for primitive in (primitive for item in tree["meshes"] for primitive in item["primitives"]):
            views = dict.fromkeys(primitive["attributes"].values(), VERTEX_BUFFER)
            for accessor, target in (views | {primitive["indices"]: INDEX_BUFFER}).items():
                tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = target

    scene = trimesh.Scene(mesh)
    return bytes(export_glb(scene, include_normals=True, tree_postprocessor=complete))


def _trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.triangles, vertex_normals=surface.normals, process=False)


def _surface_edges(
    height: np.ndarray,
    used: np.ndarray,
    contour: Contour,
    normals: np.ndarray,
    camera: np.ndarray | None,
    max_step: float,
    max_slope: float,
) -> np.ndarray:
    """Return which edges (2, H, W; to the next row, to the next column) lie on the surface and not across a step.

    An edge that cannot be tested counts as surface unless it is too steep.
    """
    known = np.isfinite(normals).all(axis=-1)
    edges = grid_edges(np.where(known[..., None], normals, 0.0), used, known.astype(float), camera, MIN_COSINE)
    tested = known & (contour.distance >= CONTOUR_MARGIN_PX)
    steepest = max(max_slope, float(np.sqrt(2.0 * inradius_of(used))))
    kept = np.zeros(edges.inside.shape, bool)
    for axis in range(2):
        rise = np.roll(height, -1, axis) - height
        forward = np.abs(rise - edges.forward_rise[axis]) * edges.normal_share
        backward = np.abs(rise - edges.backward_rise[axis]) * np.roll(edges.normal_share, -1, axis)
        # An edge without both normals, or in the margin, where heights are extrapolated, cannot be tested.
        untested = ~tested | ~np.roll(tested, -1, axis)
        explained = (np.minimum(forward, backward) <= max_step) | untested
        kept[axis] = edges.inside[axis] & explained & (np.abs(rise) <= steepest)
    return kept


def _height(depth: np.ndarray, used: np.ndarray, camera: np.ndarray | None) -> np.ndarray:
    """Return the depth (H, W) as a height in pixels, see `integration.edges`; any where it is not used."""
    height = np.where(used, depth, 1.0).astype(float)
    return height if camera is None else -focal_length(camera) * np.log(height)


def _triangles(used: np.ndarray, kept: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return triangles (M, 3) of flat pixel numbers: each square of four pixels is split along its flatter diagonal."""
    number = np.arange(used.size).reshape(used.shape)
    top_left, top_right = number[:-1, :-1], number[:-1, 1:]
    bottom_left, bottom_right = number[1:, :-1], number[1:, 1:]
    left, top = kept[0, :-1, :-1], kept[1, :-1, :-1]
    right, bottom = kept[0, :-1, 1:], kept[1, 1:, :-1]
    height = np.where(used, depth, 0.0)
    falling = np.abs(height[:-1, :-1] - height[1:, 1:])
    rising = np.abs(height[:-1, 1:] - height[1:, :-1])
    # A triangle needs the two edges of the square that it holds; a square that lacks an edge has room for one triangle.
    whole = left & top & right & bottom
    split_falling = whole & (falling <= rising)
    split_rising = whole & ~split_falling
    vacant = ~whole
    pieces = []
    for corners, edges, split in (
        ((top_left, bottom_left, bottom_right), left & bottom, split_falling),
        ((top_left, bottom_right, top_right), top & right, split_falling),
        ((top_left, bottom_left, top_right), left & top, split_rising),
        ((top_right, bottom_left, bottom_right), bottom & right, split_rising),
    ):
        single = vacant & edges
        vacant = vacant & ~single
        chosen = split | single
        pieces.append(np.stack([corner[chosen] for corner in corners], axis=-1))
    return np.concatenate(pieces)


def _vertex_normals(normals: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the given normals (N, 3), unit; a missing one is the area-weighted mean of its triangles' normals."""
    out = unit(normals.astype(float))
    missing = ~np.isfinite(out).all(axis=-1)
    if missing.any():
        faces = triangle_vectors(vertices.astype(float), triangles)
        sums = np.zeros(vertices.shape)
        for corner in range(3):
            np.add.at(sums, triangles[:, corner], faces)
        out[missing] = unit(sums)[missing]
    return out.astype(np.float32)
