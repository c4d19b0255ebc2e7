"""From a sculpted mesh to a clean one: screened Poisson reconstruction of its oriented points, watertight again."""

import numpy as np
import open3d as o3d
import trimesh

from tasks.algorithms.errors import UnusableCapture


def close(vertices: np.ndarray, normals: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """The largest closed surface of oriented points (N, 3): vertices (V, 3), triangles (F, 3) wound outwards.

    cell: edge of the finest cells, world units; detail below it is smoothed.

    Raises:
        UnusableCapture: the points give no closed surface.
    """
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(vertices, float)))
    cloud.normals = o3d.utility.Vector3dVector(np.ascontiguousarray(normals, float))
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=0, width=cell)
    return tidy(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def tidy(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest part of a mesh, without degenerate triangles, oriented outwards.

    Raises:
        UnusableCapture: nothing is left, or it is not closed.
    """
    mesh = trimesh.Trimesh(vertices, triangles, process=True, validate=True)
    parts = mesh.split(only_watertight=False)
    if not len(parts):
        raise UnusableCapture("the views give no surface", "check the poses and the masks")
    part = max(parts, key=lambda each: abs(each.volume))
    part.fix_normals()
    return np.asarray(part.vertices, float), np.asarray(part.faces, np.int64)


def reduced(vertices: np.ndarray, triangles: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """A mesh of at most so many triangles, by quadric decimation; as it is if it has no more."""
    if len(triangles) <= most:
        return vertices, triangles
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles.astype(np.int32))
    ).simplify_quadric_decimation(most)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)
