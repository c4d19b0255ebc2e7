"""Rays cast at triangle meshes, by Open3D's RaycastingScene (Embree: Wald, Woop, Benthin, Johnson and Ernst 2014).

In one thread: a run has a worker for each processor. Open3D takes a second to import, for which processes that only
name stages need not wait.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from open3d.core import Tensor


class RayHits(NamedTuple):
    """What rays (...) meet first.

    distance: (...) float32, from the origin, in lengths of the direction; inf where a ray meets nothing, and all else
    is meaningless. mesh, triangle: (...) uint32, number of the mesh and of its triangle. uv: (..., 2) float32,
    barycentric coordinates of the triangle's second and third corner. facet_normals: (..., 3) float32, of the triangle,
    unit.
    """

    distance: np.ndarray
    mesh: np.ndarray
    triangle: np.ndarray
    uv: np.ndarray
    facet_normals: np.ndarray

    @property
    def is_hit(self) -> np.ndarray:
        """Whether each ray meets a mesh, (...) bool."""
        return np.isfinite(self.distance)


class RayScene:
    """Meshes at which rays can be cast; intersections are computed in single precision."""

    def __init__(self, *meshes: tuple[np.ndarray, np.ndarray]) -> None:
        """Add meshes, each of vertices (N, 3) and triangles (M, 3)."""
        import open3d as o3d

        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        for vertices, triangles in meshes:
            self._scene.add_triangles(
                self._tensor(np.ascontiguousarray(vertices, np.float32)),
                self._tensor(np.ascontiguousarray(triangles, np.uint32)),
            )

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        """Return what rays from origins (..., 3) in directions (..., 3) meet first."""
        hits = self._scene.cast_rays(self._rays(origins, directions), nthreads=1)
        names = ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals")
        return RayHits(*(hits[name].numpy() for name in names))

    def occluded(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return whether rays from origins (..., 3) in directions (..., 3) meet anything, (...) bool."""
        return np.asarray(self._scene.test_occlusions(self._rays(origins, directions), nthreads=1).numpy())

    def _rays(self, origins: np.ndarray, directions: np.ndarray) -> "Tensor":
        return self._tensor(np.concatenate([origins, directions], axis=-1).astype(np.float32))


def interpolated(values: np.ndarray, triangles: np.ndarray, numbers: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Return values (N, C) float64 of vertices, interpolated linearly over their triangles (M, 3).

    numbers (R,), uv (R, 2): the triangles, and places on them, as in `RayHits`; the result is (R, C).
    """
    uv = uv.astype(float)
    weights = np.stack([1.0 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    return np.asarray((values[triangles[numbers]] * weights[..., None]).sum(axis=1))
