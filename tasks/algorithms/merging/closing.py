"""From a sculpted mesh to a clean one: screened Poisson reconstruction of its oriented points, watertight again."""

import numpy as np
import open3d as o3d

from tasks.algorithms.errors import UnusableCapture

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
        mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=0, width=cell, scale=ROOM)
    return tidy(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def tidy(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest connected part of a mesh, without degenerate triangles; floaters are left behind.

    Raises:
        UnusableCapture: nothing is left.
    """
    mesh = _open3d(vertices, triangles)
    mesh.remove_duplicated_vertices()
    mesh.remove_degenerate_triangles()
    labels, _, areas = (np.asarray(each) for each in mesh.cluster_connected_triangles())
    if not len(areas):
        raise UnusableCapture("the views give no surface", "check the poses and the masks")
    mesh.remove_triangles_by_mask(labels != areas.argmax())
    mesh.remove_unreferenced_vertices()
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)


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
