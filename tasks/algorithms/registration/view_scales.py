"""Scales of views: how much larger or smaller each one's pixels are than stated, from the silhouettes.

A sphere's radius, and so the scale, is known to a percent of itself, and the camera may have been moved or zoomed
between views. Silhouette coherence (epipolar_tangency) shows it: the ray through the top of the object in one view must
touch the hull of all others. A prior holds the scales near those stated, and their common factor, which no silhouette
knows, at one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere
from glint.tasks.algorithms.registration.epipolar_tangency import fit_silhouettes
from glint.tasks.algorithms.registration.turntable import (
    ANGLE_ERROR_DEG,
    AXIS_ERRORS,
    Turntable,
    views_on_turntable,
)

SCALE_ERROR = 0.01
"""Relative standard deviation of a view's stated scale."""
MIN_SCALE_CORRECTION, MAX_SCALE_CORRECTION = 0.005, 0.05
"""Corrections below which all stated scales are kept, and beyond which: what needs a larger one is another mistake."""
MIN_SCALED_VIEWS = 3
"""Views from which their scales are compared: two of them agree in the height of the object alone."""


def scaled(view: View, factor: float) -> View:
    """Return an orthographic view whose pixels cover `factor` times as much of the world."""
    return replace(view, pixel_size=factor * view.pixel_size)


def fit_scales(views: Sequence[View], table: Turntable | None) -> np.ndarray:
    """Return the factors (V,) of the views' pixel sizes at which their silhouettes agree best.

    All are 1 where none differs from it by more than the silhouettes err, or one by too much for an error of scale.

    table: the turntable on which the first views stand, its axis and angles solved with the scales, since they would
    bend to wrong ones; None: all poses are held. Perspective views keep their scales: on a turntable these are
    distances, which silhouettes hold less well than spheres do.
    """
    on_table = 0 if table is None else len(table.angles)
    free = [number for number, view in enumerate(views) if view.matrix is None]
    factors = np.ones(len(views))
    if len(views) < MIN_SCALED_VIEWS or not free:
        return factors
    centre, radius = bounding_sphere(views)
    sizes = np.array([view.footprint(centre[None])[0] for view in views])
    percent_of_object = radius / 50
    # Unknowns: percent of the scales, then percent of the object's size, and degrees, of the turntable.
    errors = np.full(len(free), 100.0 * SCALE_ERROR)
    if table is not None:
        errors = np.concatenate([errors, AXIS_ERRORS, np.full(on_table, ANGLE_ERROR_DEG)])

    def views_at(unknowns: np.ndarray) -> list[View]:
        rescaled = list(views)
        for number, percent in zip(free, unknowns, strict=False):
            rescaled[number] = scaled(views[number], float(np.exp(percent / 100)))
        if table is None:
            return rescaled
        return views_on_turntable(rescaled, table.changed(unknowns[len(free) :], percent_of_object))

    unknowns, _ = fit_silhouettes(
        views_at, np.ones(len(errors)), sizes, lambda unknowns: unknowns / errors, np.diag(1.0 / errors)
    )
    factors[free] = np.exp(unknowns[: len(free)] / 100)
    largest = np.abs(np.log(factors)).max()
    return factors if MIN_SCALE_CORRECTION < largest < MAX_SCALE_CORRECTION else np.ones(len(views))
