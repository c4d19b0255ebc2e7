"""Depth maps merged as they are: range scans, and what merging is compared with that solves no offsets."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from glint.tasks.algorithms.multiview.normal_fusion import vertex_normals
from glint.tasks.algorithms.multiview.poisson import close
from glint.tasks.algorithms.multiview.raycast import cast
from glint.tasks.algorithms.multiview.reconstruction import Model
from glint.tasks.algorithms.multiview.view import View

FAR = 2.0
"""Cells between a vertex and the nearest point of a depth map beyond which the vertex counts as unobserved."""


def points_of(view: View, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3), normals (N, 3) of the world and confidence (N,) of a view's pixels whose depth is known.

    depth (H, W): the camera frame's z, world units, NaN where it is unknown.
    """
    rows, columns = np.nonzero(view.mask & np.isfinite(depth) & np.isfinite(view.normals).all(axis=-1))
    starts, directions = view.rays(columns, rows)
    wanted = depth[rows, columns] - (starts @ view.rotation[2] + view.translation[2])
    points = starts + (wanted / (directions @ view.rotation[2]))[:, None] * directions
    return points, view.to_world(view.normals[rows, columns].astype(float)), view.confidence[rows, columns]


def merge_depths(views: Sequence[View], depths: Sequence[np.ndarray], cell: float) -> Model:
    """The closed surface of all depth maps (H, W), by screened Poisson reconstruction of their oriented points.

    cell: finest edge in world units. `confidence` and `source` are those of the nearest point, 0 and -1 where there is
    none within FAR cells.

    Raises:
        UnusableCapture: no surface is left.
    """
    parts = [points_of(view, depth) for view, depth in zip(views, depths, strict=True)]
    points, normals, confidence = (np.concatenate([part[each] for part in parts]) for each in range(3))
    origin = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    vertices, triangles = close(points, normals, cell)
    apart, nearest = cKDTree(points).query(vertices)
    near = apart < FAR * cell
    return Model(
        vertices,
        triangles,
        vertex_normals(vertices, triangles),
        np.where(near, confidence[nearest], 0.0),
        np.where(near, origin[nearest], -1),
        cell,
    )


def shifted_to(hull: Model, view: View, depth: np.ndarray) -> np.ndarray:
    """A depth map (H, W), world units, shifted as a whole to the mean depth at which the view meets the hull."""
    met = cast(hull, view)[0]
    both = np.isfinite(met) & np.isfinite(depth)
    shift = float((met[both] - depth[both]).mean()) if both.any() else 0.0
    return np.asarray(depth + np.float32(shift))
