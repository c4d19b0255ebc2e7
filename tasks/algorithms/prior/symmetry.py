"""Turned objects: most glasses, bottles and domes are surfaces of revolution, and their outline shows it.

A mirror axis of the silhouette may be the image of an axis of revolution. For a tilt of that axis towards the camera,
the largest turned body inside the silhouette follows from it (`turned_body`). Accepted highlights tell the tilt, if the
object is turned at all, and the slopes of its profile. The body then knows what no highlight shows and no smooth
field guesses: feet, shoulders, flat ends, and the far wall seen through an opening.
"""

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import angles, to_camera
from glint.tasks.algorithms.prior.reflection_axes import Axis, mirror_axes
from glint.tasks.algorithms.prior.surface_of_revolution import Turned, turned_body

STEEPEST = 75
"""Degrees of tilt that are tried: circles are ellipses up to there."""
FITTING = 5.0
"""Mean angle in degrees (each capped at FAR) between accepted normals and those of a turned object's body."""
FAR = 20.0
SAMPLES = 1500
"""Accepted normals that are compared for each tilt."""
TILT = 3.75
"""Degrees either side of each tilt that is tried first; the best is refined from there."""
ROUGHLY = 2.0, 8
"""Step in pixels along the axis, and every which sample, for that first look."""
LIKELY = 1.3
"""Times the least error of that look up to which an axis is followed up."""
OPEN_WITHIN, OPEN_SHARE = 8.0, 0.5
"""An end is an opening where so large a share of its pixels has a candidate within so many degrees of the far wall."""
LEAST_OPENING = 0.005
"""Share of the object's pixels through which the far wall must be seen."""
EXCELS = 0.4
"""Share of the smooth field's mean angle to the accepted normals below which a turned body's must be."""
OBSERVABLE = float(np.cos(np.radians(40.0)))


def turned_normals(
    mask: np.ndarray,
    accepted: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray | None = None,
    weights: np.ndarray | None = None,
) -> np.ndarray | None:
    """The normals (H, W, 3) float32 of the turned object that a silhouette shows, NaN outside; None where it is none.

    mask (H, W) bool; accepted (H, W, 3) normals of accepted highlights, NaN elsewhere; candidates (K, H, W, 3), NaN
    where there is none, tell whether an end is an opening; field (H, W, 3): the silhouette's smooth field, which the
    turned object must clearly excel; weights (H, W): of the accepted normals in the profile, 1 each if not given.
    """
    bar = FITTING
    if field is not None and np.isfinite(accepted[..., 0]).any():
        off = np.minimum(angles(field, accepted), FAR)
        bar = min(bar, EXCELS * float(off[np.isfinite(off)].mean()))
    body = _fitted(mask, accepted, bar)
    if body is None:
        return None
    rows, columns = np.nonzero(mask)
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    seen = np.isfinite(accepted[rows, columns, 0])
    counted = np.ones(len(rows)) if weights is None else weights[rows, columns]
    body = body.fitted_to(x[seen], y[seen], accepted[rows, columns][seen], counted[seen])
    normals = body.normals(x, y)
    cap = normals @ (body.upward * np.sign(body.tilt)) > np.cos(np.radians(25.0))
    if cap.any():
        inner = body.normals(x[cap], y[cap], far=True)
        told = inner[:, 2] > OBSERVABLE
        nearest = angles(candidates[:, rows[cap], columns[cap]], inner[None])
        open_here = (np.nan_to_num(nearest, nan=180.0).min(axis=0) < OPEN_WITHIN)[told]
        if told.sum() > LEAST_OPENING * len(rows) and open_here.mean() > OPEN_SHARE:
            normals[cap] = np.where(inner[:, 2:] > 0, inner, normals[cap])
    result = np.full((*mask.shape, 3), np.nan, np.float32)
    result[rows, columns] = normals
    nearest = ndimage.distance_transform_edt(np.isnan(result[..., 0]), return_distances=False, return_indices=True)
    return np.where(mask[..., None], result[tuple(nearest)], np.nan)


def _fitted(mask: np.ndarray, accepted: np.ndarray, bar: float = FITTING) -> Turned | None:
    """The turned body that agrees best with the accepted normals, if its mean angle to them is below the bar."""
    rows, columns = np.nonzero(mask & np.isfinite(accepted[..., 0]))
    if len(rows) < 20:
        return None
    # At random: every so many pixels in order are a few columns of the image.
    chosen = np.random.default_rng(0).permutation(len(rows))[:SAMPLES]
    rows, columns = rows[chosen], columns[chosen]
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    seen = accepted[rows, columns]

    def misfit(axis: Axis, tilt: float, step: float = 1.0, every: int = 1) -> float:
        body = turned_body(mask, axis, tilt, step)
        off = np.nan_to_num(angles(body.normals(x[::every], y[::every]), seen[::every]), nan=FAR)
        return float(np.minimum(off, FAR).mean())

    best, found = bar, None
    tilts = np.radians(np.arange(-STEEPEST, STEEPEST + 1, 2 * TILT))
    rough = {axis: [misfit(axis, tilt, *ROUGHLY) for tilt in tilts] for axis in mirror_axes(mask)}
    for axis, errors in rough.items():
        if min(errors) > LIKELY * min(map(min, rough.values())):
            continue
        tilt, turn = float(tilts[int(np.argmin(errors))]), np.radians(TILT)
        least = misfit(axis, tilt)
        while turn > np.radians(0.1):
            near = [each for each in (tilt - turn, tilt + turn) if abs(each) <= np.radians(STEEPEST)]
            error, other = min((misfit(axis, each), each) for each in near)
            if error < least:
                least, tilt = error, other
            else:
                turn /= 2
        if least < best:
            best, found = least, turned_body(mask, axis, tilt)
    return found
