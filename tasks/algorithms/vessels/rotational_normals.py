"""Normals of objects that are rotationally symmetric, or whose body is, under either camera.

Under a perspective camera the surface is looked for in the image of a camera aimed at the object, where its silhouette
is symmetric, with the rays of that camera.
"""

from dataclasses import dataclass
from functools import cache, cached_property, partial
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import pixel_positions
from glint.tasks.algorithms.revolution.opening import agreement
from glint.tasks.algorithms.revolution.surface_fit import (
    COARSE_STEP_PX,
    COARSE_TILT_STEP_DEG,
    SAMPLED_NORMALS,
    TILT_STEP_DEG,
    TILTS,
    SilhouetteSymmetry,
    refined_tilt,
)
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.revolution.symmetry import (
    SYMMETRIC_LIMITS,
    RotationalNormals,
    picture,
    sampled_candidates,
    surface_of_revolution_normals,
)
from glint.tasks.algorithms.silhouettes.aimed_view import AimedView
from glint.tasks.algorithms.vessels.body_normals import body_normals, observed_error, observed_normals
from glint.tasks.algorithms.vessels.bowls import Rim, accepted_bowl, bowl_rims, find_bowl

UNPROVEN_LIMITS = SYMMETRIC_LIMITS._replace(is_of_slopes=True, relief_excuses=False)
"""Limits for a symmetric silhouette whose accepted normals are not compared with the smooth field: they agree with it
because it accepted them."""
UNPROVEN_ERROR_RATIO = 0.95
"""Error of such a surface on all that was observed, relative to the smooth field's, up to which it is preferred: 0.93
on vases whose relief is too fine for most highlights, 0.96 and more on domes and cut stones."""


@dataclass(frozen=True, eq=False)
class RotationalSymmetry:
    """Search for a rotationally symmetric object in a view; what it computes of the silhouette is kept for the next.

    mask: (H, W) bool, the silhouette. camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for
    parallel rays.
    """

    mask: np.ndarray
    camera: np.ndarray | None

    def normals(self, accepted: np.ndarray, candidates: np.ndarray, field: np.ndarray) -> RotationalNormals | None:
        """Return the normals of an object that is rotationally symmetric, or whose body is, else None.

        All normals are relative to the view rays. The depths are heights: under perspective the negative logarithm of
        the distance times the focal length. For the arguments see `surface_of_revolution_normals`.
        """
        aimed, fit = self._aimed, (accepted, candidates, field)
        if aimed is not None:
            fit = aimed.normals(accepted), self._shown(candidates), aimed.normals(field)
        result = body_normals(self._symmetry, *fit) or accepted_bowl(self._rims, fit[0], fit[2])
        return result if aimed is None or result is None else result.seen_back(aimed)

    def unproven_normals(self, accepted: np.ndarray, candidates: np.ndarray, field: np.ndarray) -> np.ndarray | None:
        """Return the normals (H, W, 3) of a surface of revolution that fits what was observed better than the field.

        Accepted normals do not contradict it, though they may show none, as where the smooth field accepts little of a
        fine relief. None: there is no such surface, or the silhouette is not symmetric. For the arguments see
        `surface_of_revolution_normals`.
        """
        aimed, shown = self._aimed, self._shown(candidates)
        if aimed is not None:
            accepted, field = aimed.normals(accepted), aimed.normals(field)
        fitted = surface_of_revolution_normals(self._symmetry, accepted, shown, limits=UNPROVEN_LIMITS)
        if fitted is None:
            return None
        observed = observed_normals(accepted, shown)
        if observed_error(fitted.normals, *observed) > UNPROVEN_ERROR_RATIO * observed_error(field, *observed):
            return None
        return fitted.normals if aimed is None else aimed.normals_back(fitted.normals)

    def supposed_normals(self, candidates: np.ndarray) -> np.ndarray | None:
        """Return the normals (H, W, 3) of the surface of revolution inside the silhouette that most candidates show.

        None if no silhouette of a body is symmetric, or if the candidates (K, H, W, 3), NaN where there is none,
        contradict most of what could be observed of each surface.
        """
        aimed, shown = self._aimed, self._shown(candidates)
        silhouettes = [self._symmetry] if self._symmetry.axes else self._symmetry.bodies + self._symmetry.completions
        excess, surface = max(
            (_best_surface(silhouette, shown) for silhouette in silhouettes), key=itemgetter(0), default=(0.0, None)
        )
        bowl = find_bowl(self._rims, shown)
        if bowl is not None and bowl.excess > excess:
            normals = bowl.normals().normals
        elif surface is not None:
            normals = self._normals_of(surface)
        else:
            return None
        return normals if aimed is None else aimed.normals_back(normals)

    def _normals_of(self, surface: SurfaceOfRevolution) -> np.ndarray:
        """Return the normals (H, W, 3) of a surface as the view in which it was looked for shows it."""
        mask = self._symmetry.mask
        return with_nearest(picture(mask, surface.normals(*pixel_positions(mask))), mask)

    def _shown(self, candidates: np.ndarray) -> np.ndarray:
        """Return candidates (K, H, W, 3) as the view in which the surface is looked for shows them."""
        aimed = self._aimed
        return candidates if aimed is None else aimed.candidates(candidates)

    @cached_property
    def _aimed(self) -> AimedView | None:
        return None if self.camera is None else AimedView.at(self.mask, self.camera)

    @cached_property
    def _symmetry(self) -> SilhouetteSymmetry:
        aimed = self._aimed
        return SilhouetteSymmetry(self.mask) if aimed is None else SilhouetteSymmetry(aimed.silhouette, 1 / aimed.focal)

    @cached_property
    def _rims(self) -> list[Rim]:
        return bowl_rims(self._symmetry)


def _best_surface(silhouette: SilhouetteSymmetry, candidates: np.ndarray) -> tuple[float, SurfaceOfRevolution | None]:
    """Return the surface of revolution that candidates (K, H, W, 3) show best, and its excess.

    That is the share of the pixels with a candidate that agree with it, less that of those that should and do not.
    """
    x, y, sampled = sampled_candidates(silhouette.mask, candidates, SAMPLED_NORMALS)

    @cache
    def contradiction(axis: int, tilt: float) -> float:
        surface = silhouette.surface(axis, tilt, COARSE_STEP_PX)
        hits = surface.intersect(x, y)
        agrees, is_end = agreement(surface.normals_at(hits), sampled), surface.is_end_at(hits)
        # An end may be open, and show the far wall.
        far = agreement(surface.normals(x[is_end], y[is_end], far=True), sampled[:, is_end])
        agrees[is_end] = np.maximum(agrees[is_end], far)
        return -float(agrees.sum()) / max(len(x), 1)

    best: tuple[float, SurfaceOfRevolution | None] = (0.0, None)
    for axis in range(len(silhouette.axes)):
        contradiction_at = partial(contradiction, axis)
        tilt = min(map(float, TILTS), key=contradiction_at)
        least, tilt = refined_tilt(contradiction_at, tilt, TILT_STEP_DEG, COARSE_TILT_STEP_DEG)
        if -least > best[0]:
            best = -least, silhouette.surface(axis, tilt, COARSE_STEP_PX)
    return best
