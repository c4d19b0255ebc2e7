"""Solids of flat faces as a view shows them: normals, depths and faces of its pixels."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple, Protocol

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.distance import inradius_of, with_nearest
from glint.tasks.algorithms.geometry.perspective import centred_view_vectors, rotate_to_view
from glint.tasks.algorithms.geometry.vectors import positions_at, unit
from glint.tasks.algorithms.silhouettes.aimed_search import AimedSearch

BEND_INRADII = 0.05
"""Half the width in inradii over which normals are averaged, since edges are rounded."""
PLANE_DECIMALS = 5
"""Decimals of their normals to which faces of the same plane agree."""


class Polyhedron(Protocol):
    """Solid of flat faces before a camera, in pixels."""

    @property
    def normals(self) -> np.ndarray:
        """Unit normals (F, 3) of the visible faces, camera frame."""

    @property
    def inverse_focal(self) -> float:
        """1 over the focal length in pixels, 0 for parallel rays."""

    def faces(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the number (H, W) of the visible face at each pixel of an image of this shape, -1 beside the solid."""

    def depths(self, x: np.ndarray, y: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return z (N,) in pixels of the faces (N,) at image positions x, y (N,), up to a constant for all."""


class PolyhedralNormals(NamedTuple):
    """Normals and depths of a solid of flat faces.

    normals: (H, W, 3) float32, relative to the view rays, NaN outside the object. depths: (H, W) float32, z of its
    faces in pixels towards the camera, up to a constant; under perspective heights, as of `RotationalNormals`. faces:
    (H, W) int, numbers of the visible faces, those of one plane the same, -1 beside them. log_ratio: how much
    candidates speak for it, nats.
    """

    normals: np.ndarray
    depths: np.ndarray
    faces: np.ndarray
    log_ratio: float

    def faces_in(self, mask: np.ndarray) -> Iterator[np.ndarray]:
        """Yield the pixels (H, W) bool of each visible face in a mask (H, W) bool."""
        return (mask & (self.faces == face) for face in range(self.faces.max() + 1))


@dataclass(frozen=True, eq=False)
class PolyhedronSearch(AimedSearch):
    """Search for a solid of flat faces in a view."""

    def _seen_back(self, solid: PolyhedralNormals) -> PolyhedralNormals:
        """Return what the camera's own image shows of a solid in that view."""
        if self._aimed is None:
            return solid
        normals, depths = self._aimed.normals_back(solid.normals), self._aimed.heights_back(solid.depths)
        return PolyhedralNormals(normals, depths, self._aimed.numbers_back(solid.faces), solid.log_ratio)


def sampled_middle(shape: tuple[int, ...], stride: int) -> np.ndarray:
    """Return where the centre of every `stride`-th pixel lies, x and y (2,) from that of all, in an image (H, W)."""
    lost = (np.array(shape) - 1) % stride
    return np.array([-lost[1], lost[0]]) / 2.0


def climbed[Solid, Step](
    start: tuple[float, Solid],
    score: Callable[[Solid], float],
    beside: Callable[[Solid, Step], Iterable[Solid]],
    steps: Iterable[Step],
) -> tuple[float, Solid]:
    """Return the largest score and its solid, sought from a start by steps in turn.

    start: score of a solid, and the solid. beside: returns the solids a step beside one.
    """
    best = start
    for step in steps:
        best = max(best, *((score(other), other) for other in beside(best[1], step)), key=itemgetter(0))
    return best


def polyhedral_normals(solid: Polyhedron, log_ratio: float, mask: np.ndarray) -> PolyhedralNormals:
    """Return what a mask (H, W) bool shows of a solid; log_ratio: how much candidates speak for it, nats."""
    faces = solid.faces(mask.shape)
    rows, columns = np.indices(mask.shape, dtype=float)
    x, y = positions_at(rows, columns, mask.shape)
    is_seen = faces >= 0
    normals, depths = np.full((*mask.shape, 3), np.nan), np.full(mask.shape, np.nan, np.float32)
    normals[is_seen] = solid.normals[faces[is_seen]]
    depths[is_seen] = solid.depths(x[is_seen], y[is_seen], faces[is_seen])
    side = 2 * round(BEND_INRADII * inradius_of(mask)) + 1
    flat = np.where(mask[..., None], with_nearest(normals, mask), 0.0)
    rounded = np.full(flat.shape, np.nan)
    rounded[mask] = unit(ndimage.uniform_filter(flat, (side, side, 0))[mask])
    # An end is one face, even if its sides are drawn one by one.
    _, planes = np.unique(solid.normals.round(PLANE_DECIMALS), axis=0, return_inverse=True)
    return PolyhedralNormals(
        rotate_to_view(rounded, centred_view_vectors(mask.shape, solid.inverse_focal)),
        depths,
        np.where(is_seen, planes[faces], -1),
        log_ratio,
    )
