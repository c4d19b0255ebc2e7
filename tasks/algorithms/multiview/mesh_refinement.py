"""Sculpting: moving a mesh's vertices along their normals until the surface has the normals that the views saw.

One closed mesh under all views at once takes the place of depth maps: there are no offsets between them to find, and
the drift that integration gathers along one view is held by the others and by the silhouettes. With the displacement h
of each vertex along its normal m as the only unknown, all wishes are linear in h, and a step solves one sparse system:

- each edge (i, j) of a triangle is perpendicular to the normal n seen there: n . (x_i + h_i m_i - x_j - h_j m_j) = 0;
- no vertex leaves the silhouettes; where an outline lost contact with the surface, its nearest vertex is drawn back;
- the displacement is smooth, and small where nobody knows better.
"""

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sparse
from scipy import ndimage
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from glint.tasks.algorithms.multiview.normal_fusion import Fused, fuse, vertex_normals
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import Outline

STAY, SMOOTH = 1e-3, 0.05
"""Weights of staying where one is, and of moving as the neighbours do."""
INSIDE, CONTACT = 1.0, 0.3
"""Weights of a vertex outside an outline, and of an outline's contact with the surface."""
LARGEST = 3.0
"""Longest step in mean edge lengths: visibility and normals are looked at anew before the next one."""
GRAZING = 0.5
"""Most cosine between normal and line of sight of a vertex that may be on the outline."""
REACH = 15.0
"""Pixels from an outline within which its contact is looked for."""


def sculpt(
    views: Sequence[View],
    outlines: Sequence[Outline],
    vertices: np.ndarray,
    triangles: np.ndarray,
    steps: int = 5,
    progress: Callable[[], None] | None = None,
) -> tuple[np.ndarray, Fused]:
    """Vertices (N, 3) after so many steps, and what the views say of them; the triangles (M, 3) stay as they are."""
    smoothness = _smoothness(len(vertices), triangles)
    edge = float(np.linalg.norm(vertices[triangles[:, 0]] - vertices[triangles[:, 1]], axis=1).mean())
    fused = fuse(views, vertices, triangles)
    for step in range(steps):
        normals = vertex_normals(vertices, triangles)
        matrix, right = _normal_equations(vertices, normals, triangles, fused)
        matrix = matrix + SMOOTH * smoothness + STAY * sparse.identity(len(vertices))
        for view, outline in zip(views, outlines, strict=True):
            bound, wanted = _outline_equations(view, outline, vertices, normals, contact=step > 0)
            matrix, right = matrix + bound, right + wanted
        height = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        ).solve(right)
        vertices = vertices + np.clip(height, -LARGEST * edge, LARGEST * edge)[:, None] * normals
        fused = fuse(views, vertices, triangles)
        if progress is not None:
            progress()
    return vertices, fused


def _normal_equations(
    vertices: np.ndarray, normals: np.ndarray, triangles: np.ndarray, fused: Fused
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Quadratic form and right side of the edges' equations, weighed by what is known of each triangle."""
    weight = fused.weight[triangles]
    wanted = (weight[..., None] * fused.normals[triangles]).sum(axis=1)
    wanted /= np.maximum(np.linalg.norm(wanted, axis=1, keepdims=True), 1e-12)
    scale = np.sqrt(weight.mean(axis=1))
    count, rows = len(vertices), np.arange(len(triangles))
    matrix, right = sparse.csr_matrix((count, count)), np.zeros(count)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        i, j = triangles[:, first], triangles[:, second]
        along_i, along_j = scale * (wanted * normals[i]).sum(axis=1), scale * (wanted * normals[j]).sum(axis=1)
        rise = scale * (wanted * (vertices[j] - vertices[i])).sum(axis=1)
        values, columns = np.concatenate([along_i, -along_j]), np.concatenate([i, j])
        equations = sparse.csr_matrix((values, (np.tile(rows, 2), columns)), shape=(len(triangles), count))
        matrix, right = matrix + equations.T @ equations, right + equations.T @ rise
    return matrix, right


def _outline_equations(
    view: View, outline: Outline, vertices: np.ndarray, normals: np.ndarray, contact: bool
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Diagonal form and right side of one view's bounds: distance to the outline and its change along the normal."""
    columns, rows = view.project(vertices)
    unit = view.footprint(vertices)
    distance = outline.at(columns, rows) * unit
    change = (view.to_world(outline.slope(columns, rows)) * normals).sum(axis=1)
    weight = np.where((distance > 0) & (change > 0.05), INSIDE, 0.0)
    if contact:
        touching = _touching(view, vertices, normals, columns, rows)
        touching = touching[change[touching] > 0.3]
        weight[touching] = np.maximum(weight[touching], CONTACT)
    return sparse.diags(weight * change**2), -weight * change * distance


def _touching(
    view: View, vertices: np.ndarray, normals: np.ndarray, columns: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Vertices that are nearest to a pixel of the view's outline, among those that may be on it."""
    grazing = np.flatnonzero(np.abs((normals * view.towards(vertices)).sum(axis=1)) < GRAZING)
    if not len(grazing):
        return grazing
    inner = ndimage.binary_erosion(np.pad(view.mask, 1, mode="edge"))[1:-1, 1:-1]
    row, column = np.nonzero(view.mask & ~inner)
    tree = cKDTree(np.column_stack([columns[grazing], rows[grazing]]))
    apart, nearest = tree.query(np.column_stack([column, row]))
    return np.unique(grazing[nearest[apart < REACH]])


def _smoothness(count: int, triangles: np.ndarray) -> sparse.csr_matrix:
    """Quadratic form of the difference between each vertex and the mean of its neighbours."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    near = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    near = ((near + near.T) > 0).astype(float)
    degree = np.maximum(np.asarray(near.sum(axis=1)).ravel(), 1.0)
    difference = sparse.identity(count) - sparse.diags(1.0 / degree) @ near
    return difference.T @ difference
