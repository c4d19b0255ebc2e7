"""Rays that touch the body: through each pixel of an outline goes one, and it must touch the hull of all other views.

How far it passes by, or how deep it would have to run inside all the others' outlines, is zero for consistent poses
where two outlines meet, whatever the body's shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import Outline, ball_around

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
        points = np.stack(
            [_along(view, self.columns[each], self.rows[each], self.along[each]) for each, view in enumerate(views)]
        )
        found = np.zeros(self.by.shape)
        for number, (view, outline) in enumerate(zip(views, outlines, strict=True)):
            chosen = self.by == number
            found[chosen] = _distance(view, outline, points[chosen])
        return found / sizes[:, None]


def tangents(views: Sequence[View], outlines: Sequence[Outline], rays: int = RAYS) -> Tangents:
    """The rays of all views against the outlines of the others."""
    columns, rows = np.moveaxis(np.array([rim_points(view.mask, rays) for view in views]), 1, 0)
    ball = ball_around(views)
    along, by, distance = zip(
        *(_touching(views, outlines, number, columns[number], rows[number], ball) for number in range(len(views))),
        strict=True,
    )
    return Tangents(columns, rows, np.array(along), np.array(by), np.array(distance))


def _touching(
    views: Sequence[View],
    outlines: Sequence[Outline],
    number: int,
    columns: np.ndarray,
    rows: np.ndarray,
    ball: tuple[np.ndarray, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`along`, `by` and `distance` (R,) of the rays of one view; ball: centre and radius of one around the object."""
    others = np.array([each for each in range(len(views)) if each != number])
    starts, directions = views[number].rays(columns, rows)

    def outside(along: np.ndarray) -> np.ndarray:
        points = _along(views[number], columns, rows, along)
        return np.stack([_distance(views[each], outlines[each], points) for each in others])

    along = ((ball[0] - starts) * directions).sum(axis=1)[:, None] + np.linspace(-ball[1], ball[1], COARSE)
    step = 2 * ball[1] / (COARSE - 1)
    for _ in range(2):
        best = np.take_along_axis(along, outside(along).max(axis=0).argmin(axis=1)[:, None], axis=1)
        along = best + np.linspace(-step, step, FINE)
        step *= 2 / (FINE - 1)
    best = np.take_along_axis(along, outside(along).max(axis=0).argmin(axis=1)[:, None], axis=1)
    distances = outside(best)[..., 0]
    pixel = views[number].footprint(ball[0][None])
    return best[:, 0], others[distances.argmax(axis=0)], distances.max(axis=0) / pixel


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
