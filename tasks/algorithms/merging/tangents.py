"""Rays that touch the body: through each pixel of an outline goes one, and it must touch the hull of all other views.

How far it passes by, or how deep it would have to run inside all the others' outlines, is zero for consistent poses
where two outlines meet, whatever the body's shape.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from tasks.algorithms.merging.hull import Outline, ball_around
from tasks.algorithms.merging.views import View

RAYS = 48
"""Rays taken of each outline to judge it."""
COARSE, FINE = 40, 9
"""Points looked at along a ray, first from end to end, then round the best."""


@dataclass(frozen=True, slots=True)
class Tangents:
    """The rays through R rim pixels of each of V views, and where each comes deepest into the others' outlines.

    columns, rows (V, R); along (V, R): that place on the ray, in world units; by (V, R): the view whose outline is the
    nearest there; distance (V, R): from that outline in pixels of the ray's view, positive outside.
    """

    columns: np.ndarray
    rows: np.ndarray
    along: np.ndarray
    by: np.ndarray
    distance: np.ndarray

    def distances(self, views: Sequence[View], outlines: Sequence[Outline], sizes: np.ndarray) -> np.ndarray:
        """The same distances (V, R) with the views placed a little otherwise: to first order, the places stay.

        sizes (V,): world units of each view's pixels.
        """
        points = np.stack([_along(view, *self._pixels(each), self.along[each]) for each, view in enumerate(views)])
        found = np.zeros(self.by.shape)
        for number, (view, outline) in enumerate(zip(views, outlines, strict=True)):
            chosen = self.by == number
            found[chosen] = _distance(view, outline, points[chosen])
        return found / sizes[:, None]

    def _pixels(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        return self.columns[number], self.rows[number]


def tangents(views: Sequence[View], outlines: Sequence[Outline], rays: int = RAYS) -> Tangents:
    """The rays of all views against the outlines of the others."""
    centre, reach = ball_around(views)
    pixels = np.array([rim_points(view.mask, rays) for view in views])
    places, by, nearest = [], [], []
    for number, view in enumerate(views):
        others = [each for each in range(len(views)) if each != number]

        def deepest(
            along: np.ndarray, view: View = view, number: int = number, others: list[int] = others
        ) -> np.ndarray:
            points = _along(view, *pixels[number], along)
            return np.stack([_distance(views[each], outlines[each], points) for each in others])

        starts, directions = view.rays(*pixels[number])
        along = _least(lambda at: deepest(at).max(axis=0), ((centre - starts) * directions).sum(axis=1), reach)
        values = deepest(along[:, None])[..., 0]
        places.append(along)
        by.append(np.array(others)[values.argmax(axis=0)])
        nearest.append(values.max(axis=0) / view.footprint(centre[None]))
    return Tangents(pixels[:, 0], pixels[:, 1], np.array(places), np.array(by), np.array(nearest))


def misses(views: Sequence[View], outlines: Sequence[Outline], rays: int = RAYS) -> np.ndarray:
    """By how much (V, rays), in pixels, the rays through each view's outline pass by the hull of the other views."""
    return np.maximum(tangents(views, outlines, rays).distance, 0.0)


def rim_points(mask: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows (count,) of pixels of a mask's rim, evenly taken around it; the region's border is none."""
    rim = mask & ~ndimage.binary_erosion(np.pad(mask, 1, mode="edge"))[1:-1, 1:-1]
    rows, columns = np.nonzero(rim)
    around = np.argsort(np.arctan2(rows - rows.mean(), columns - columns.mean()), kind="stable")
    taken = around[np.linspace(0, len(around) - 1, count).round().astype(int)]
    return columns[taken].astype(float), rows[taken].astype(float)


def _along(view: View, columns: np.ndarray, rows: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Points (R, 3) or (R, N, 3) at distances (R,) or (R, N) along rays."""
    starts, directions = view.rays(columns, rows)
    extra = (None,) * (along.ndim - 1)
    return starts[:, *extra] + along[..., None] * directions[:, *extra]


def _distance(view: View, outline: Outline, points: np.ndarray) -> np.ndarray:
    """World units (...,) by which points (..., 3) lie outside a view's outline."""
    flat = points.reshape(-1, 3)
    return (outline.at(*view.project(flat)) * view.footprint(flat)).reshape(points.shape[:-1])


def _least(function: Callable[[np.ndarray], np.ndarray], middle: np.ndarray, reach: float) -> np.ndarray:
    """Where (R,) along rays a function of places (R, N) is least, within `reach` of the middle (R,)."""
    along = middle[:, None] + np.linspace(-reach, reach, COARSE)
    step = 2 * reach / (COARSE - 1)
    for _ in range(2):
        best = np.take_along_axis(along, function(along).argmin(axis=1)[:, None], axis=1)
        along = best + np.linspace(-step, step, FINE)
        step *= 2 / (FINE - 1)
    return np.take_along_axis(along, function(along).argmin(axis=1)[:, None], axis=1)[:, 0]
