"""Triangulate a depth map in the camera frame, cut where the surface steps.

A range image becomes a mesh by joining neighbouring pixels unless they lie across a depth discontinuity (after Turk and
Levoy, Zippered Polygon Meshes from Range Images, SIGGRAPH 1994). Here an edge is a discontinuity if the normals at
both ends fail to explain the rise along it, as in bilateral integration (`integration.edges`).
"""

from dataclasses import dataclass

import numpy as np

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


@dataclass(frozen=True, slots=True)
class RegionCamera:
    """The camera of a region: where its pixels lie in space.

    origin: column and row of the region's top-left pixel in the full frame. frame: width and height of the full frame;
    None: the region is the frame. pixel_size: unit per pixel (1 leaves pixels), which scales all three coordinates of
    an orthographic depth; the frame's centre has x = y = 0. Ignored with a matrix. matrix: (3, 3) intrinsic, in pixels
    of the full frame; the camera is at the origin and looks along -z. None: orthographic.
    """

    origin: tuple[int, int] = (0, 0)
    frame: tuple[int, int] | None = None
    pixel_size: float = 1.0
    matrix: np.ndarray | None = None

    @property
    def region_matrix(self) -> np.ndarray | None:
        """The matrix (3, 3) in pixels of the region; None: orthographic."""
        return None if self.matrix is None else camera_in_crop(self.matrix, *self.origin)

    def height(self, depth: np.ndarray, used: np.ndarray) -> np.ndarray:
        """Return the depth (H, W) as a height in pixels, see `integration.edges`; any where it is not used (H, W)."""
        height, matrix = np.where(used, depth, 1.0).astype(float), self.region_matrix
        return height if matrix is None else -focal_length(matrix) * np.log(height)

    def points(self, columns: np.ndarray, rows: np.ndarray, depth: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """Return the points (N, 3) at columns, rows and depth (N,) of a region of this size (width, height)."""
        matrix = self.region_matrix
        if matrix is None:
            x, y = to_camera(columns + self.origin[0], rows + self.origin[1], *(self.frame or size))
            return np.stack([x, y, depth], axis=-1) * self.pixel_size
        rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(matrix).T
        return depth[:, None] * rays * CAMERA_FLIP


ORTHOGRAPHIC = RegionCamera()
"""The camera of a region that is the whole frame, in pixels."""


def mesh_from_depth(
    depth: np.ndarray,
    mask: np.ndarray,
    normals: np.ndarray,
    camera: RegionCamera = ORTHOGRAPHIC,
    *,
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
        camera: of the region.
        confidence: (H, W) in 0..1.
        max_step, max_slope: see MAX_STEP_PX and MAX_SLOPE.

    Raises:
        UnusableCapture: no triangle is left.
        ValueError: shapes do not agree.
    """
    if not depth.shape == mask.shape == normals.shape[:2]:
        raise ValueError(f"depth {depth.shape}, mask {mask.shape} and normals {normals.shape} do not agree")
    used = np.asarray(mask, bool) & np.isfinite(depth)
    height, contour, matrix = camera.height(depth, used), contour_of(used), camera.region_matrix
    triangles = _triangles(used, _surface_edges(height, used, contour, normals, matrix, max_step, max_slope), depth)
    if not len(triangles):
        raise UnusableCapture("the depth holds no triangle", "the mask must be at least two pixels wide somewhere")

    kept, compact = np.unique(triangles, return_inverse=True)
    compact = compact.reshape(-1, 3).astype(np.int32)
    rows, columns = (index.astype(float) for index in np.divmod(kept, depth.shape[1]))
    distance = depth.reshape(-1)[kept].astype(float)
    boundary = boundary_vertices(compact)
    right, down, closer = moves_to_contour(height, used, contour, kept[boundary])
    columns[boundary] += right
    rows[boundary] += down
    if matrix is None:
        distance[boundary] += closer
    else:
        distance[boundary] *= np.exp(-closer / focal_length(matrix))
    vertices = camera.points(columns, rows, distance, depth.shape[::-1]).astype(np.float32)
    vertex_normals = _vertex_normals(normals.reshape(-1, 3)[kept], vertices, compact)
    vertex_confidence = np.ones(len(kept)) if confidence is None else np.nan_to_num(confidence.reshape(-1)[kept])
    return Surface(vertices, compact, vertex_normals, vertex_confidence.astype(np.float32))


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
