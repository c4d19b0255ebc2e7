"""Screened Poisson surface reconstruction of oriented points: of a refined mesh, or of depth maps.

Kazhdan and Hoppe, Screened Poisson Surface Reconstruction, ACM Transactions on Graphics 2013 (Open3D's implementation).
A mesh's own vertices, reconstructed, give a watertight surface without folds. Depth maps are range scans, or the
baseline of the evaluation that solves no offsets between views.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.mesh import Model, largest_component, vertex_normals
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.view import View

BOX_SCALE = 1.4
"""Size of the reconstruction's box relative to the points' bounding box: a surface that bulges out where there are no
points must not be cut off."""
MAX_GAP_CELLS = 2.0
"""Cells between a vertex and the nearest point of a depth map beyond which the vertex counts as unobserved."""


def poisson_reconstruction(points: np.ndarray, normals: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest closed surface of oriented points: vertices (V, 3), triangles (F, 3) wound outwards.

    points, normals (N, 3): world coordinates, normals unit and outwards; cell: edge of the finest octree cells, world
    units; finer detail is smoothed.

    Raises:
        UnusableCapture: the points give no closed surface.
    """
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(points, float)))
    cloud.normals = o3d.utility.Vector3dVector(np.ascontiguousarray(normals, float))
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            # Several threads gain no time here.
            mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
                cloud, depth=0, width=cell, scale=BOX_SCALE, n_threads=1
            )
        except RuntimeError as error:
            # Open3D's answer to points that span no volume, and to none at all.
            raise UnusableCapture(
                f"no closed surface runs through {len(points)} points with normals", "check the poses and the masks"
            ) from error
    return largest_component(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def oriented_points(view: View, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (N, 3), normals (N, 3), world, and confidence (N,) of a view's pixels with known depth and normal.

    depth (H, W): the camera frame's z, world units, NaN where it is unknown.
    """
    rows, columns = np.nonzero(view.mask & np.isfinite(depth) & np.isfinite(view.normals).all(axis=-1))
    starts, directions = view.rays(columns, rows)
    rise = depth[rows, columns] - (starts @ view.rotation[2] + view.translation[2])
    points = starts + (rise / (directions @ view.rotation[2]))[:, None] * directions
    return points, view.to_world(view.normals[rows, columns].astype(float)), view.confidence[rows, columns]


def merge_depth_maps(views: Sequence[View], depths: Sequence[np.ndarray], cell: float) -> Model:
    """Reconstruct the closed surface of all depth maps (H, W) from their oriented points.

    cell: finest edge in world units. `confidence` and `source` are those of the nearest point, 0 and -1 where there is
    none within MAX_GAP_CELLS cells.

    Raises:
        UnusableCapture: no surface is left.
    """
    parts = [oriented_points(view, depth) for view, depth in zip(views, depths, strict=True)]
    points, normals, confidence = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    source = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    vertices, triangles = poisson_reconstruction(points, normals, cell)
    distance, nearest = cKDTree(points).query(vertices)
    is_observed = distance < MAX_GAP_CELLS * cell
    return Model(
        vertices,
        triangles,
        vertex_normals(vertices, triangles),
        np.where(is_observed, confidence[nearest], 0.0),
        np.where(is_observed, source[nearest], -1),
        cell,
    )


def align_depth(hull: Model, view: View, depth: np.ndarray) -> np.ndarray:
    """Shift a depth map (H, W), world units, to the mean depth at which the view's rays hit the hull."""
    hull_depth = raycast(hull, view)[0]
    shared = np.isfinite(hull_depth) & np.isfinite(depth)
    shift = float((hull_depth[shared] - depth[shared]).mean()) if shared.any() else 0.0
    return np.asarray(depth + np.float32(shift))
