"""The visual hull: what all silhouettes leave (shape from silhouettes).

A point's signed distance to a view's outline, negative inside, bounds the surface from outside. The largest of all
views is the hull's field; its zero set is the hull.
"""

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.view import View, sample

BLUR = 1.0
"""Standard deviation in pixels of the smoothing of the outline's staircase."""
BEYOND = 0.5
"""Pixels around the region in which distances are known, as a share of its longer side."""
START = 48
"""Cells along each side of the first, coarse look for the hull."""


@dataclass(frozen=True, slots=True)
class Outline:
    """Signed distance of a view's outline in pixels, negative inside, over the region and `pad` pixels around it.

    distance, right, down: (H + 2 pad, W + 2 pad), the field and its derivatives along columns and rows.
    """

    distance: np.ndarray
    right: np.ndarray
    down: np.ndarray
    pad: int

    def at(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Distances (N,) in pixels at positions of the region."""
        return sample(self.distance, columns + self.pad, rows + self.pad)

    def slope(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Gradients (N, 3) in the camera frame, per pixel."""
        x, y = (
            sample(self.right, columns + self.pad, rows + self.pad),
            sample(self.down, columns + self.pad, rows + self.pad),
        )
        return np.stack([x, -y, np.zeros_like(x)], axis=-1)


_TRACED: dict[int, Outline] = {}
"""Outlines of the masks in memory, by their identity."""


def outline_of(mask: np.ndarray) -> Outline:
    """The outline of a mask (H, W) bool. Where the mask runs into the border, the object is taken to go on beyond.

    It is kept as long as the mask, which must not be changed.
    """
    key = id(mask)
    if key not in _TRACED:
        _TRACED[key] = _traced(mask)
        weakref.finalize(mask, _TRACED.pop, key, None).atexit = False
    return _TRACED[key]


def _traced(mask: np.ndarray) -> Outline:
    pad = int(BEYOND * max(mask.shape)) + 8
    whole = np.pad(mask, pad, mode="edge") if _is_cut(mask) else np.pad(mask, pad)
    distance = ndimage.distance_transform_edt(~whole) - ndimage.distance_transform_edt(whole)
    distance = ndimage.gaussian_filter(distance - 0.5 * np.sign(distance), BLUR)
    down, right = np.gradient(distance)
    return Outline(distance, right, down, pad)


def _is_cut(mask: np.ndarray) -> bool:
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())


def hull_field(views: Sequence[View], outlines: Sequence[Outline]) -> Callable[[np.ndarray], np.ndarray]:
    """The hull as a function of points (N, 3): signed distance (N,) in world units, negative inside."""

    def field(points: np.ndarray) -> np.ndarray:
        value = np.full(len(points), -np.inf)
        for view, outline in zip(views, outlines, strict=True):
            np.maximum(value, outline.at(*view.project(points)) * view.footprint(points), out=value)
        return value

    return field


def bounding_box(views: Sequence[View], outlines: Sequence[Outline]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners (3,) of a box around the hull, a little larger than it.

    Raises:
        UnusableCapture: the silhouettes have no point in common.
    """
    centre, radius = ball_around(views)
    field = hull_field(views, outlines)
    low, high = centre - radius, centre + radius
    for _ in range(2):
        axes = [np.linspace(a, b, START) for a, b in zip(low, high, strict=True)]
        cell = (high - low) / (START - 1)
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        inside = grid[field(grid) < np.linalg.norm(cell)]
        if not len(inside):
            raise UnusableCapture(
                "the silhouettes of the views have no point in common", "check the poses, and the masks"
            )
        low, high = np.maximum(inside.min(axis=0) - cell, low), np.minimum(inside.max(axis=0) + cell, high)
    return low, high


def ball_around(views: Sequence[View]) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius of a ball that holds the object: where the rays through the masks' middles meet."""
    total, right = np.zeros((3, 3)), np.zeros(3)
    middles = []
    for view in views:
        rows, columns = np.nonzero(view.mask)
        middle = np.array([(columns.min() + columns.max()) / 2]), np.array([(rows.min() + rows.max()) / 2])
        start, direction = (each[0] for each in view.rays(*middle))
        across = np.eye(3) - np.outer(direction, direction)
        total, right = total + across, right + across @ start
        middles.append(float(np.hypot(np.ptp(columns), np.ptp(rows)) / 2))
    centre = np.linalg.solve(total + 1e-9 * np.eye(3), right)
    sizes = [extent * float(view.footprint(centre[None])[0]) for view, extent in zip(views, middles, strict=True)]
    return centre, 1.2 * max(sizes)
