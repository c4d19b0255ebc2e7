"""Closed triangle meshes: the model, its vertex normals, its largest component, and decimation.

Vertex normals are weighted by the areas of the triangles; decimation is by quadric error metrics (Garland and Heckbert
1997, as in Open3D).
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.triangles import triangle_vectors


@dataclass(frozen=True, slots=True)
class Model:
    """A closed surface in world coordinates.

    vertices (N, 3) float64 and triangles (M, 3) int64, wound outwards; normals (N, 3) unit; confidence (N,) in 0..1,
    the probability that the normal is within 5 degrees, 0 where no view shows the surface and it is only bounded by
    the hull; source (N,) int: the index of the view with the largest weight, -1 for none; cell: edge in world units.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    source: np.ndarray
    cell: float


def face_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return unit normals (M, 3) of triangles (M, 3) of vertices (N, 3); zero for a degenerate triangle."""
    face = triangle_vectors(vertices, triangles)
    return np.asarray(face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-12))


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return unit normals (N, 3) of vertices (N, 3): the area-weighted mean over their triangles (M, 3)."""
    face = triangle_vectors(vertices, triangles)
    total = np.zeros_like(vertices)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(triangles[:, corner], face[:, axis], len(vertices))
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def largest_component(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (V, 3) and triangles (T, 3) of the connected component of the largest area.

    Triangles that name a vertex twice are left out.

    Raises:
        UnusableCapture: no triangle is left.
    """
    is_proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles = np.asarray(triangles, np.int64)[is_proper]
    if not len(triangles):
        raise UnusableCapture("the views give no surface", "check the poses and the masks")
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    graph = sparse.coo_matrix((np.ones(len(edges), bool), edges.T), shape=(len(vertices), len(vertices)))
    component = connected_components(graph, directed=False)[1][triangles[:, 0]]
    area = np.linalg.norm(triangle_vectors(vertices, triangles), axis=1)
    is_largest = component == np.bincount(component, area).argmax()
    kept, numbers = np.unique(triangles[is_largest], return_inverse=True)
    return np.asarray(vertices[kept], float), numbers.reshape(-1, 3)


def decimated(vertices: np.ndarray, triangles: np.ndarray, max_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Decimate vertices (N, 3) and triangles (M, 3) to at most `max_triangles`; a smaller mesh is returned as it is."""
    if len(triangles) <= max_triangles:
        return vertices, triangles
    import open3d as o3d

    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, float)),
        o3d.utility.Vector3iVector(np.ascontiguousarray(triangles, np.int32)),
    ).simplify_quadric_decimation(max_triangles)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)
