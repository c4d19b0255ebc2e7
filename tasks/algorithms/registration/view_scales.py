"""Scales of views: how much larger or smaller each one's pixels are than stated, from the silhouettes.

A sphere's radius, and so the scale, is known to a percent of itself, and the camera may have been moved or zoomed
between views. Silhouette coherence (epipolar_tangency) shows it: the ray through the top of the object in one view must
touch the hull of all others. A prior holds the scales near those stated, and their common factor, which no silhouette
knows, at one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from glint.tasks.algorithms.geometry.perspective import areal_focal_length
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere
from glint.tasks.algorithms.registration.epipolar_tangency import (
    CALIBRATION_RAYS,
    robust_residuals,
    trace_silhouette_rays,
)

SCALE_ERROR = 0.01
"""Relative standard deviation of a view's stated scale."""
MIN_SCALE_CORRECTION, MAX_SCALE_CORRECTION = 0.005, 0.05
"""Corrections below which all stated scales are kept, and beyond which: what needs a larger one is another mistake."""
SCALE_STEP = 1e-3
"""Relative step of numerical derivatives."""
MAX_SCALE_EVALUATIONS = 8
"""Evaluations of the least-squares solver."""


def scaled(view: View, factor: float) -> View:
    """Return a view whose pixels cover `factor` times as much of the world.

    A perspective camera on a turntable is then so many times as far from the axis.
    """
    pixel_size = factor * view.pixel_size
    if view.matrix is None:
        return replace(view, pixel_size=pixel_size)
    translation = np.array([*view.translation[:2], -pixel_size * areal_focal_length(view.matrix)])
    return replace(view, pixel_size=pixel_size, translation=translation)


def fit_scales(views: Sequence[View], on_table: int) -> np.ndarray:
    """Return the factors (V,) of the views' pixel sizes at which their silhouettes agree best; their poses are held.

    All are 1 where none differs from it by more than the silhouettes err, or one by too much for an error of scale.

    on_table: how many views, the first, stand on a turntable. A perspective view whose pose is a matrix has no scale of
    its own, and 1.
    """
    free = [number for number, view in enumerate(views) if view.matrix is None or number < on_table]
    centre = bounding_sphere(views)[0][None]
    sizes = np.array([view.footprint(centre)[0] for view in views])

    def at(logarithms: np.ndarray) -> list[View]:
        result = list(views)
        for number, logarithm in zip(free, logarithms, strict=True):
            result[number] = scaled(views[number], float(np.exp(logarithm)))
        return result

    def residuals(logarithms: np.ndarray) -> np.ndarray:
        distances = trace_silhouette_rays(at(logarithms), CALIBRATION_RAYS).distance
        return np.concatenate([robust_residuals(distances)[0], logarithms / SCALE_ERROR])

    def jacobian(logarithms: np.ndarray) -> np.ndarray:
        rays = trace_silhouette_rays(at(logarithms), CALIBRATION_RAYS)
        slope = robust_residuals(rays.distance)[1]
        columns = []
        for step in SCALE_STEP * np.eye(len(free)):
            forward, backward = (rays.distances(at(logarithms + sign * step), sizes) for sign in (1.0, -1.0))
            columns.append(slope * (forward - backward).ravel() / (2 * SCALE_STEP))
        return np.vstack([np.stack(columns, axis=1), np.eye(len(free)) / SCALE_ERROR])

    factors = np.ones(len(views))
    if len(views) > 2 and free:
        solution = least_squares(
            residuals, np.zeros(len(free)), jac=jacobian, max_nfev=MAX_SCALE_EVALUATIONS, xtol=1e-4, ftol=1e-4
        )
        factors[free] = np.exp(solution.x)
    largest = np.abs(np.log(factors)).max()
    return factors if MIN_SCALE_CORRECTION < largest < MAX_SCALE_CORRECTION else np.ones(len(views))
