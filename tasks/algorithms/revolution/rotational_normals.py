"""Normals of objects that are rotationally symmetric, or whose body is, under either camera.

Under a perspective camera the surface is looked for in the image of a camera aimed at the object, where its silhouette
is symmetric, with the rays of that camera.
"""

from dataclasses import dataclass
from functools import cache, cached_property, partial
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import pixel_positions, positions_at, sampled_pixels
from glint.tasks.algorithms.revolution.handles import handles_beside, with_handles
from glint.tasks.algorithms.revolution.opening import agreement
from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG, capped_angles
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
    FitLimits,
    RotationalNormals,
    surface_of_revolution_normals,
)
from glint.tasks.algorithms.silhouettes.aimed_view import AimedView
from glint.tasks.algorithms.silhouettes.measured_silhouettes import measured_silhouettes

IMPERFECT_LIMITS = FitLimits(6.0, 0.5, is_of_slopes=True)
"""Limits for a body with a handle, among whose accepted normals are some of the handle's: its profile is uncertain, so
that fitted slopes decide."""
COMPLETED_LIMITS = IMPERFECT_LIMITS._replace(relief_excuses=False)
"""Limits for a silhouette that is not the mask's own; with enough periods, relief explains any normals."""
MEASURED_LIMITS = COMPLETED_LIMITS._replace(error_deg=4.2, simpler_error_ratio=SYMMETRIC_LIMITS.simpler_error_ratio)
"""Limits for a silhouette that normals measure: it follows those of other smooth shapes to 4.5 degrees, but where a
surface of revolution is seen, to less than 4."""
UNPROVEN_LIMITS = SYMMETRIC_LIMITS._replace(is_of_slopes=True, relief_excuses=False)
"""Limits for a symmetric silhouette whose accepted normals are not compared with the smooth field: they agree with it
because it accepted them."""
UNPROVEN_ERROR_RATIO = 0.95
"""Error of such a surface on all that was observed, relative to the smooth field's, up to which it is preferred: 0.93
on vases whose relief is too fine for most highlights, 0.96 and more on domes and cut stones."""
MEASURED_ERROR_RATIO, DOUBTED_ERROR_RATIO = 0.96, 0.9
"""Error of a silhouette that normals measure, relative to that of a part of the mask, and of the mask itself, up to
which it is preferred: it follows some of the normals by which both are judged."""
DOUBTED_ERROR_DEG = 4.0
"""Mean angle of accepted normals from the surface in the mask's own silhouette from which the mask is doubted: right
masks have 1.6 to 4.6 degrees."""


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
        result = _best_normals(self._symmetry, *fit)
        if aimed is None or result is None:
            return result
        normals, heights = aimed.normals_back(result.normals), aimed.heights_back(result.depths)
        return result._replace(normals=normals, depths=heights)

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
        observed = _observed(accepted, shown)
        if _observed_error(fitted.normals, *observed) > UNPROVEN_ERROR_RATIO * _observed_error(field, *observed):
            return None
        return fitted.normals if aimed is None else aimed.normals_back(fitted.normals)

    def supposed_normals(self, candidates: np.ndarray) -> np.ndarray | None:
        """Return the normals (H, W, 3) of the surface of revolution inside the silhouette that most candidates show.

        None if no silhouette of a body is symmetric, or if the candidates (K, H, W, 3), NaN where there is none,
        contradict most of what could be observed of each surface.
        """
        aimed, shown = self._aimed, self._shown(candidates)
        silhouettes = [self._symmetry] if self._symmetry.axes else self._symmetry.bodies + self._symmetry.completions
        _, surface = max(
            (_best_surface(silhouette, shown) for silhouette in silhouettes), key=itemgetter(0), default=(0.0, None)
        )
        if surface is None:
            return None
        mask = self._symmetry.mask
        normals = np.full((*mask.shape, 3), np.nan, np.float32)
        normals[mask] = surface.normals(*pixel_positions(mask))
        normals = with_nearest(normals, mask)
        return normals if aimed is None else aimed.normals_back(normals)

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


def _best_surface(silhouette: SilhouetteSymmetry, candidates: np.ndarray) -> tuple[float, SurfaceOfRevolution | None]:
    """Return the surface of revolution that candidates (K, H, W, 3) show best, and how many more agree than do not."""
    mask = silhouette.mask
    rows, columns = sampled_pixels(mask & np.isfinite(candidates[..., 0]).any(axis=0), SAMPLED_NORMALS)
    x, y = positions_at(rows, columns, mask.shape)
    sampled = candidates[:, rows, columns]

    @cache
    def contradiction(axis: int, tilt: float) -> float:
        surface = silhouette.surface(axis, tilt, COARSE_STEP_PX)
        hits = surface.intersect(x, y)
        agrees, is_end = agreement(surface.normals_at(hits), sampled), surface.is_end_at(hits)
        # An end may be open, and show the far wall.
        far = agreement(surface.normals(x[is_end], y[is_end], far=True), sampled[:, is_end])
        agrees[is_end] = np.maximum(agrees[is_end], far)
        return -float(agrees.sum())

    best: tuple[float, SurfaceOfRevolution | None] = (0.0, None)
    for axis in range(len(silhouette.axes)):
        contradiction_at = partial(contradiction, axis)
        tilt = min(map(float, TILTS), key=contradiction_at)
        least, tilt = refined_tilt(contradiction_at, tilt, TILT_STEP_DEG, COARSE_TILT_STEP_DEG)
        if -least > best[0]:
            best = -least, silhouette.surface(axis, tilt, COARSE_STEP_PX)
    return best


def _best_normals(
    silhouette: SilhouetteSymmetry,
    accepted: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray,
) -> RotationalNormals | None:
    """Return the normals of the surface of revolution in a silhouette, or in another one if that may be imperfect.

    It may have handles, or lack a part. None: there is no such surface. For the arguments see
    `surface_of_revolution_normals`.
    """
    own = surface_of_revolution_normals(silhouette, accepted, candidates, field)
    if own is not None and (own.relief_fit > 0.0 or own.round_error < DOUBTED_ERROR_DEG):
        return own
    mask, observed = silhouette.mask, _observed(accepted, candidates)
    measured = [SilhouetteSymmetry(part, silhouette.inverse_focal) for part in measured_silhouettes(mask, accepted)]
    if own is None:
        parts = [(body, IMPERFECT_LIMITS, 1.0) for body in silhouette.bodies]
        parts += [(whole, COMPLETED_LIMITS, 1.0) for whole in silhouette.completions]
        parts += [(whole, MEASURED_LIMITS, MEASURED_ERROR_RATIO) for whole in measured]
        least_error: float = np.inf
    else:
        parts = [(whole, MEASURED_LIMITS, DOUBTED_ERROR_RATIO) for whole in measured]
        least_error = _observed_error(own.normals, *observed)
    best: tuple[np.ndarray, RotationalNormals] | None = None
    for part, limits, error_ratio in parts:
        within = np.where(part.mask[..., None], accepted, np.nan)
        fitted = surface_of_revolution_normals(part, within, candidates, field, limits)
        if fitted is not None:
            error = _observed_error(fitted.normals, *observed) / error_ratio
            if error < least_error:
                least_error, best = error, (part.mask, fitted)
    if best is None:
        return own
    part_mask, fitted = best
    if own is None and silhouette.axes and not (part_mask & ~mask).any():
        whole = _surface_of_the_whole(silhouette, (part_mask, fitted), accepted, candidates, field)
        if whole is not None:
            return whole
    normals = with_handles(fitted.normals, handles_beside(mask, part_mask), mask, accepted, candidates)
    is_body = (normals == fitted.normals).all(axis=-1)
    return fitted._replace(normals=normals, depths=np.where(is_body, fitted.depths, np.nan))


def _surface_of_the_whole(
    silhouette: SilhouetteSymmetry,
    body: tuple[np.ndarray, RotationalNormals],
    accepted: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray,
) -> RotationalNormals | None:
    """Return the normals of the surface in a symmetric silhouette, if a part of it is the body of such a surface.

    What lies beside the body is as symmetric as the body: no handle, but more of it, of which false normals were
    accepted. None: what was observed on the body fits that worse than the body's own surface.

    Args:
        silhouette: symmetric.
        body: part (H, W) bool of the silhouette, and its surface.
        accepted, candidates, field: see `surface_of_revolution_normals`.
    """
    mask, fitted = body
    within, shown = (np.where(mask[..., None], normals, np.nan) for normals in (accepted, candidates))
    whole = surface_of_revolution_normals(silhouette, within, candidates, field, IMPERFECT_LIMITS)
    if whole is None:
        return None
    observed = _observed(within, shown)
    is_better = _observed_error(whole.normals, *observed) <= _observed_error(fitted.normals, *observed)
    return whole if is_better else None


def _observed(accepted: np.ndarray, candidates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (H, W) bool with candidates, and the normals (K, N, 3) that they show.

    Where a normal is accepted it is the only one. What no normal was accepted of, as the far wall seen through an
    opening, tells surfaces apart that fit a wall alike.
    """
    is_accepted = np.isfinite(accepted[..., 0])
    is_observed = is_accepted | np.isfinite(candidates[..., 0]).any(axis=0)
    shown = np.array(candidates[:, is_observed])
    shown[:, is_accepted[is_observed]] = accepted[is_accepted]
    return is_observed, shown


def _observed_error(normals: np.ndarray, is_observed: np.ndarray, shown: np.ndarray) -> float:
    """Return the mean capped angle in degrees of normals (H, W, 3) to the nearest of those shown; see `_observed`."""
    return float(capped_angles(normals[is_observed][None], shown).min(axis=0, initial=ERROR_CAP_DEG).mean())
