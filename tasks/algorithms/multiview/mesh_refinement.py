"""Normal-guided mesh refinement: move vertices along their normals until the surface has the normals of the views.

Follows the linear combination of positions and normals of Nehab, Rusinkiewicz, Davis and Ramamoorthi (Efficiently
Combining Positions and Normals for Precise 3D Geometry, SIGGRAPH 2005), on one closed mesh under all views instead of
on depth maps: there are no offsets between views to solve, and the low-frequency drift of integration along one view is
held by the other views and by the silhouettes. With the displacement h of each vertex along its normal m as the only
unknown, all terms are linear in h, and a step solves one sparse system:

- each edge (i, j) of a triangle is perpendicular to the fused normal n: n . (x_i + h_i m_i - x_j - h_j m_j) = 0;
- where the surface settles against a normal, as behind a step that smooth normals run across, the normal gives way;
- no vertex leaves a silhouette; where a silhouette has lost contact with the surface, its nearest vertex is drawn back;
- the displacement is smooth, and small where no view is confident.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from glint.tasks.algorithms.geometry.contours import outermost_pixels
from glint.tasks.algorithms.multiview.mesh import face_normals, vertex_normals
from glint.tasks.algorithms.multiview.normal_fusion import FusedNormals, fuse_normals
from glint.tasks.algorithms.multiview.view import View

DAMPING_WEIGHT, SMOOTHNESS_WEIGHT = 1e-3, 0.05
"""Weights of a small displacement, and of one that equals the mean of its neighbours'."""
SILHOUETTE_WEIGHT = 1.0
"""Weight of a silhouette, for vertices outside it and for the one that touches it."""
MIN_CONTAINMENT_SLOPE, MIN_CONTACT_SLOPE = 0.05, 0.3
"""Cosine between a vertex's normal and the silhouette's from which moving the vertex can correct its distance."""
MAX_STEP_EDGES = 3.0
"""Longest step in mean edge lengths: visibility and normals are evaluated again before the next one."""
MAX_CONTACT_COSINE = 0.5
"""Largest cosine between normal and view vector of a vertex that may lie on the silhouette."""
CONTACT_RADIUS_PX, CONTACT_NEIGHBOURS = 15.0, 4
"""Pixels from a point of a silhouette within which its vertex of contact is searched, and how many nearest vertices."""
TOLERANCE_DEG = (np.inf, 60.0, 40.0, 30.0, 20.0)
"""Degrees between a triangle and its fused normal at which the normal's weight is halved, by step; later steps are as
the last. In the first step all normals count: the surface may be wrong itself (graduated non-convexity, Blake and
Zisserman 1987)."""
BASE_WEIGHT, BASE_BAND_PX, MIN_BASE_COSINE = 0.3, 0.7, 0.5
"""Weight of the base plane's normal, at vertices within so many pixels of it whose normals point downwards."""


def refine_mesh(
    views: Sequence[View],
    vertices: np.ndarray,
    triangles: np.ndarray,
    steps: int,
    *,
    base: float | None = None,
    is_robust: bool = False,
    progress: Callable[[], None] | None = None,
) -> np.ndarray:
    """Return vertices (N, 3) after so many steps of refinement; the triangles (M, 3) stay as they are.

    base: the height y of the plane on which the object stands, None: unknown; is_robust: whether normals that the
    surface contradicts lose weight by TOLERANCE_DEG (a hull contradicts most); progress: called after each step.
    """
    smoothness = _smoothness(len(vertices), triangles)
    edge = float(np.linalg.norm(vertices[triangles[:, 0]] - vertices[triangles[:, 1]], axis=1).mean())
    for step in range(steps):
        fused = fuse_normals(views, vertices, triangles)
        normals = vertex_normals(vertices, triangles)
        if base is not None:
            fused = _with_base_normals(views, vertices, normals, fused, base)
        tolerance = TOLERANCE_DEG[min(step, len(TOLERANCE_DEG) - 1)] if is_robust else np.inf
        matrix, right_side = _normal_equations(vertices, normals, triangles, fused, tolerance)
        matrix = matrix + SMOOTHNESS_WEIGHT * smoothness + DAMPING_WEIGHT * sparse.identity(len(vertices))
        for view in views:
            # The first step only follows the normals and stays inside; contact is restored from the second one on.
            term, term_right = _silhouette_equations(view, vertices, normals, with_contact=step > 0)
            matrix, right_side = matrix + term, right_side + term_right
        if base is not None:
            term, term_right = _containment(np.maximum(base - vertices[:, 1], 0.0), -normals[:, 1])
            matrix, right_side = matrix + term, right_side + term_right
        # The matrix is symmetric and positive definite: no pivoting is needed.
        height = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).solve(right_side)
        vertices = vertices + np.clip(height, -MAX_STEP_EDGES * edge, MAX_STEP_EDGES * edge)[:, None] * normals
        if progress is not None:
            progress()
    return vertices


def _normal_equations(
    vertices: np.ndarray, normals: np.ndarray, triangles: np.ndarray, fused: FusedNormals, tolerance_deg: float
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Return matrix (N, N) and right side (N,) of the edges' equations, weighted by the fused normals' weights.

    tolerance_deg: degrees from a triangle at which the weight of its normal is halved (Cauchy weights).
    """
    weight = fused.weight[triangles]
    target = (weight[..., None] * fused.normals[triangles]).sum(axis=1)
    target /= np.maximum(np.linalg.norm(target, axis=1, keepdims=True), 1e-12)
    angle = np.degrees(np.arccos(np.clip((face_normals(vertices, triangles) * target).sum(axis=1), -1.0, 1.0)))
    scale = np.sqrt(weight.mean(axis=1) / (1.0 + (angle / tolerance_deg) ** 2))
    count, rows = len(vertices), np.arange(len(triangles))
    matrix, right_side = sparse.csr_matrix((count, count)), np.zeros(count)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        i, j = triangles[:, first], triangles[:, second]
        coefficient_i = scale * (target * normals[i]).sum(axis=1)
        coefficient_j = scale * (target * normals[j]).sum(axis=1)
        rise = scale * (target * (vertices[j] - vertices[i])).sum(axis=1)
        values, columns = np.concatenate([coefficient_i, -coefficient_j]), np.concatenate([i, j])
        equations = sparse.csr_matrix((values, (np.tile(rows, 2), columns)), shape=(len(triangles), count))
        matrix, right_side = matrix + equations.T @ equations, right_side + equations.T @ rise
    return matrix, right_side


def _silhouette_equations(
    view: View, vertices: np.ndarray, normals: np.ndarray, with_contact: bool
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Return diagonal matrix (N, N) and right side (N,) that move vertices back to one view's silhouette.

    The distance to the silhouette is linear in the displacement: its change is the gradient's part along the normal.
    """
    columns, rows = view.project(vertices)
    distance = view.silhouette.distance.at(columns, rows) * view.footprint(vertices)
    change = (view.to_world(view.silhouette.distance.gradient(columns, rows)) * normals).sum(axis=1)
    contact = np.zeros(0, int)
    if with_contact:
        contact = _contact_vertices(view, vertices, normals, columns, rows, distance)
        contact = contact[change[contact] > MIN_CONTACT_SLOPE]
    excess = np.maximum(distance, 0.0)
    excess[contact] = distance[contact]
    return _containment(excess, change)


def _containment(excess: np.ndarray, change: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Return diagonal matrix (N, N) and right side (N,) that move vertices by which a bound is exceeded, or missed.

    excess (N,): distance of each vertex beyond the bound, negative where it is to be drawn outwards to it, 0 where it
    may stay; change (N,): of this distance with the displacement along the normal.
    """
    weight = np.where((excess != 0) & (change > MIN_CONTAINMENT_SLOPE), SILHOUETTE_WEIGHT, 0.0)
    return sparse.diags(weight * change**2), -weight * change * excess


def _contact_vertices(
    view: View,
    vertices: np.ndarray,
    normals: np.ndarray,
    columns: np.ndarray,
    rows: np.ndarray,
    distance: np.ndarray,
) -> np.ndarray:
    """Return indices of the vertices that should touch the silhouette, among those seen at a grazing angle.

    A point of the silhouette is touched by the outermost vertex near it: others lie inside rightly, and drawn to the
    silhouette too they would swell the body. columns, rows (N,): the vertices' positions in the view's region;
    distance (N,): to the silhouette, negative inside.
    """
    grazing = np.flatnonzero(np.abs((normals * view.view_vectors(vertices)).sum(axis=1)) < MAX_CONTACT_COSINE)
    if not len(grazing):
        return grazing
    tree = cKDTree(np.column_stack([columns[grazing], rows[grazing]]))
    neighbours = np.arange(1, min(CONTACT_NEIGHBOURS, len(grazing)) + 1)
    _, nearest = tree.query(_silhouette_points(view), neighbours, distance_upper_bound=CONTACT_RADIUS_PX)
    # A missing neighbour has the index len(grazing).
    outermost = np.append(distance[grazing], -np.inf)[nearest].argmax(axis=1)
    touching = np.unique(nearest[np.arange(len(nearest)), outermost])
    return grazing[touching[touching < len(grazing)]]


def _silhouette_points(view: View) -> np.ndarray:
    """Return points (M, 2), columns and rows, on a view's silhouette: one for each pixel of the mask's border.

    The pixels' centres lie half a pixel inside the silhouette.
    """
    rows, columns = np.nonzero(outermost_pixels(view.mask))
    distance, outward = view.silhouette.distance.at(columns, rows), view.silhouette.distance.gradient(columns, rows)
    return np.column_stack([columns - distance * outward[:, 0], rows + distance * outward[:, 1]])


def _with_base_normals(
    views: Sequence[View], vertices: np.ndarray, normals: np.ndarray, fused: FusedNormals, base: float
) -> FusedNormals:
    """Return the fused normals with that of the base plane at the vertices that lie on it and point downwards."""
    pixel = float(np.median([view.footprint(vertices[:1])[0] for view in views]))
    on_base = (vertices[:, 1] < base + BASE_BAND_PX * pixel) & (normals[:, 1] < -MIN_BASE_COSINE)
    total = fused.weight[:, None] * fused.normals - np.outer(BASE_WEIGHT * on_base, [0.0, 1.0, 0.0])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    known = np.where(length > 1e-9, total / np.maximum(length, 1e-9), fused.normals)
    return replace(fused, normals=known, weight=fused.weight + BASE_WEIGHT * on_base)


def _smoothness(count: int, triangles: np.ndarray) -> sparse.csr_matrix:
    """Return the squared umbrella Laplacian (count, count): vertex minus mean of its neighbours (Taubin 1995)."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    adjacency = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    adjacency = ((adjacency + adjacency.T) > 0).astype(float)
    degree = np.maximum(np.asarray(adjacency.sum(axis=1)).ravel(), 1.0)
    laplacian = sparse.identity(count) - sparse.diags(1.0 / degree) @ adjacency
    return laplacian.T @ laplacian
