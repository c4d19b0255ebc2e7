"""From a sculpted mesh to a clean one: screened Poisson reconstruction of its oriented points, watertight again."""

import numpy as np
import open3d as o3d
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.errors import UnusableCapture

ROOM = 1.4
"""Size of the box in which the surface is looked for, relative to the points': a surface that bulges out where no point
is must not be cut off."""


def close(vertices: np.ndarray, normals: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """The largest closed surface of oriented points (N, 3): vertices (V, 3), triangles (F, 3) wound outwards.

    cell: edge of the finest cells, world units; detail below it is smoothed.

    Raises:
        UnusableCapture: the points give no closed surface.
    """
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, float)))
    cloud.normals = o3d.utility.Vector3dVector(np.ascontiguousarray(normals, float))
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        # Several threads gain no time here.
        mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
            cloud, depth=0, width=cell, scale=ROOM, n_threads=1
        )
    return tidy(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def tidy(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest connected part of a mesh, without degenerate triangles; floaters are left behind.

    Raises:
        UnusableCapture: nothing is left.
    """
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles = np.asarray(triangles, np.int64)[whole]
    if not len(triangles):
        raise UnusableCapture("the views give no surface", "check the poses and the masks")
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    graph = sparse.coo_matrix((np.ones(len(edges), bool), edges.T), shape=(len(vertices), len(vertices)))
    part = connected_components(graph, directed=False)[1][triangles[:, 0]]
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept, numbers = np.unique(triangles[part == np.bincount(part, area).argmax()], return_inverse=True)
    return np.asarray(vertices[kept], float), numbers.reshape(-1, 3)


def reduced(vertices: np.ndarray, triangles: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """A mesh of at most so many triangles, by quadric decimation; as it is if it has no more."""
    if len(triangles) <= most:
        return vertices, triangles
    mesh = _open3d(vertices, triangles).simplify_quadric_decimation(most)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)


def _open3d(vertices: np.ndarray, triangles: np.ndarray) -> o3d.geometry.TriangleMesh:
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, float)),
        o3d.utility.Vector3iVector(np.ascontiguousarray(triangles, np.int32)),
    )
