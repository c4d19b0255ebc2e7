"""Surface of revolution of a whole silhouette, of its body without handles, or of what an imperfect mask shows."""

import numpy as np

from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG, capped_angles
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.revolution.symmetry import (
    SYMMETRIC_LIMITS,
    FitLimits,
    RotationalNormals,
    surface_of_revolution_normals,
)
from glint.tasks.algorithms.silhouettes.measured_silhouettes import measured_silhouettes
from glint.tasks.algorithms.vessels.handles import handles_beside, with_handles

IMPERFECT_LIMITS = FitLimits(6.0, 0.5, is_of_slopes=True)
"""Limits for a body with a handle, among whose accepted normals are some of the handle's: its profile is uncertain, so
that fitted slopes decide."""
COMPLETED_LIMITS = IMPERFECT_LIMITS._replace(relief_excuses=False)
"""Limits for a silhouette that is not the mask's own; with enough periods, relief explains any normals."""
MEASURED_LIMITS = COMPLETED_LIMITS._replace(error_deg=4.2, simpler_error_ratio=SYMMETRIC_LIMITS.simpler_error_ratio)
"""Limits for a silhouette that normals measure: it follows those of other smooth shapes to 4.5 degrees, but where a
surface of revolution is seen, to less than 4."""
MEASURED_ERROR_RATIO, DOUBTED_ERROR_RATIO = 0.96, 0.9
"""Error of a silhouette that normals measure, relative to that of a part of the mask, and of the mask itself, up to
which it is preferred: it follows some of the normals by which both are judged."""
DOUBTED_ERROR_DEG = 4.0
"""Mean angle of accepted normals from the surface in the mask's own silhouette from which the mask is doubted: right
masks have 1.6 to 4.6 degrees."""


def body_normals(
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
    mask, observed = silhouette.mask, observed_normals(accepted, candidates)
    measured = [SilhouetteSymmetry(part, silhouette.inverse_focal) for part in measured_silhouettes(mask, accepted)]
    if own is None:
        parts = [(body, IMPERFECT_LIMITS, 1.0) for body in silhouette.bodies]
        parts += [(whole, COMPLETED_LIMITS, 1.0) for whole in silhouette.completions]
        parts += [(whole, MEASURED_LIMITS, MEASURED_ERROR_RATIO) for whole in measured]
        least_error: float = np.inf
    else:
        parts = [(whole, MEASURED_LIMITS, DOUBTED_ERROR_RATIO) for whole in measured]
        least_error = observed_error(own.normals, *observed)
    best: tuple[np.ndarray, RotationalNormals] | None = None
    for part, limits, error_ratio in parts:
        within = np.where(part.mask[..., None], accepted, np.nan)
        fitted = surface_of_revolution_normals(part, within, candidates, field, limits)
        if fitted is not None:
            error = observed_error(fitted.normals, *observed) / error_ratio
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
    tangents = None if fitted.tangents is None else np.where(is_body[..., None], fitted.tangents, np.float32(np.nan))
    return fitted._replace(normals=normals, depths=np.where(is_body, fitted.depths, np.nan), tangents=tangents)


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
    observed = observed_normals(within, shown)
    is_better = observed_error(whole.normals, *observed) <= observed_error(fitted.normals, *observed)
    return whole if is_better else None


def observed_normals(accepted: np.ndarray, candidates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (H, W) bool with candidates, and the normals (K, N, 3) that they show.

    Where a normal is accepted it is the only one. What no normal was accepted of, as the far wall seen through an
    opening, tells surfaces apart that fit a wall alike.
    """
    is_accepted = np.isfinite(accepted[..., 0])
    is_observed = is_accepted | np.isfinite(candidates[..., 0]).any(axis=0)
    shown = np.array(candidates[:, is_observed])
    shown[:, is_accepted[is_observed]] = accepted[is_accepted]
    return is_observed, shown


def observed_error(normals: np.ndarray, is_observed: np.ndarray, shown: np.ndarray) -> float:
    """Return the mean capped angle in degrees of normals (H, W, 3) to the nearest shown; see `observed_normals`."""
    return float(capped_angles(normals[is_observed][None], shown).min(axis=0, initial=ERROR_CAP_DEG).mean())
