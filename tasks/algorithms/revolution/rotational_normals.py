"""Normals of objects that are rotationally symmetric, or whose body is, under either camera.

Under a perspective camera the surface is looked for in the image of a camera aimed at the object, where its silhouette
is symmetric, with the rays of that camera.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glint.tasks.algorithms.revolution.aimed_view import AimedView
from glint.tasks.algorithms.revolution.handles import handles_beside, with_handles
from glint.tasks.algorithms.revolution.relief import capped_angles
from glint.tasks.algorithms.revolution.symmetry import (
    RotationalNormals,
    SilhouetteSymmetry,
    surface_of_revolution_normals,
)

MAX_BODY_ERROR_DEG, MAX_BODY_ERROR_RATIO = 7.5, 0.6
"""`MAX_MEAN_ERROR_DEG` and `MAX_SMOOTH_ERROR_RATIO` of a body with a handle, among whose accepted normals are some of
the handle's."""


@dataclass(frozen=True, eq=False)
class RotationalSymmetry:
    """Search for a rotationally symmetric object in a view; what it computes of the silhouette is kept for the next.

    mask: (H, W) bool, the silhouette. camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for
    parallel rays.
    """

    mask: np.ndarray
    camera: np.ndarray | None

    def normals(
        self, accepted: np.ndarray, candidates: np.ndarray, field: np.ndarray, weights: np.ndarray
    ) -> RotationalNormals | None:
        """Return the normals of an object that is rotationally symmetric, or whose body is, else None.

        All normals are relative to the view rays. The depths are heights: under perspective the negative logarithm of
        the distance times the focal length. For the arguments see `surface_of_revolution_normals`.
        """
        aimed, fit = self._aimed, (accepted, candidates, field, weights)
        if aimed is not None:
            shown = np.stack([aimed.normals(layer) for layer in candidates])
            fit = aimed.normals(accepted), shown, aimed.normals(field), aimed.values(weights)
        result = surface_of_revolution_normals(self._symmetry, *fit) or _body_normals(self._symmetry, *fit)
        if aimed is None or result is None:
            return result
        normals, heights = aimed.normals_back(result.normals), aimed.heights_back(result.depths)
        return RotationalNormals(normals, heights, result.relief_fit)

    @cached_property
    def _aimed(self) -> AimedView | None:
        return None if self.camera is None else AimedView.at(self.mask, self.camera)

    @cached_property
    def _symmetry(self) -> SilhouetteSymmetry:
        aimed = self._aimed
        return SilhouetteSymmetry(self.mask) if aimed is None else SilhouetteSymmetry(aimed.silhouette, 1 / aimed.focal)


def _body_normals(
    silhouette: SilhouetteSymmetry,
    accepted: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray,
    weights: np.ndarray,
) -> RotationalNormals | None:
    """Return the normals of a body of revolution and its handles, None without one.

    For the arguments see `surface_of_revolution_normals`.
    """
    limits = (MAX_BODY_ERROR_DEG, MAX_BODY_ERROR_RATIO)
    least_error: float = np.inf
    best: tuple[np.ndarray, RotationalNormals] | None = None
    for body in silhouette.bodies:
        within = np.where(body.mask[..., None], accepted, np.nan)
        fitted = surface_of_revolution_normals(body, within, candidates, field, weights, *limits)
        if fitted is not None:
            error = capped_angles(fitted.normals, accepted)[np.isfinite(accepted[..., 0])].mean()
            if error < least_error:
                least_error, best = error, (body.mask, fitted)
    if best is None:
        return None
    (part, fitted), mask = best, silhouette.mask
    normals = with_handles(fitted.normals, handles_beside(mask, part), mask, accepted, candidates)
    is_body = (normals == fitted.normals).all(axis=-1)
    return RotationalNormals(normals, np.where(is_body, fitted.depths, np.nan), fitted.relief_fit)
