"""Reflection symmetry axes of a silhouette, each of which may be the image of an axis of revolution.

Source: the score of a reflection is the overlap of the silhouette with its mirror image, maximized over angle and
offset (Marola 1989).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.contours import outermost_pixels
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.vectors import pixel_positions

MIN_SYMMETRY_IOU = 0.96
"""Intersection over union of a silhouette with its mirror image from which it counts as symmetric."""
RASTER_OFFSET_PX = 0.3
"""Mean distance between the contours of a silhouette and its mirror image up to which it is symmetric in any case: the
pixels of a shape that is turned against their rows differ by 0.25, which costs a glass on a thin stem an overlap of
0.1."""
SEED_IOU_MARGIN = 0.15
"""Distance below that score that an unrefined angle may have: 1.5 degrees cost a glass on a thin stem 0.1."""
SEED_STEP_DEG, FINAL_STEP_DEG = 3.0, 0.1
"""Steps in angle of the exhaustive search, and at which refinement ends."""
MAX_SCORED_PIXELS = 4000
"""Pixels of the silhouette that are mirrored; of a larger one, every n-th."""
MIN_INRADIUS_PX = 2.0
"""Inradius below which a silhouette is a line, and has no axes."""
MAX_AXES = 4
"""Most axes of a silhouette, the best ones."""


@dataclass(frozen=True, slots=True, eq=False)
class ReflectionAxis:
    """Reflection symmetry axis of a silhouette.

    point: (2,), on the axis, camera frame, pixels. normal: (2,), unit, perpendicular to it. iou: intersection over
    union of the silhouette and its mirror image.
    """

    point: np.ndarray
    normal: np.ndarray
    iou: float

    @property
    def direction(self) -> np.ndarray:
        """Direction (2,) of the axis."""
        return np.array([-self.normal[1], self.normal[0]])


def reflection_axes(mask: np.ndarray, min_iou: float = MIN_SYMMETRY_IOU) -> list[ReflectionAxis]:
    """Return at most MAX_AXES axes of a silhouette (H, W) bool that is symmetric about them, best first.

    min_iou: overlap with its mirror image from which it is; of a thin one less is enough.
    """
    if inradius_of(mask) < MIN_INRADIUS_PX:
        return []
    points = np.stack(pixel_positions(mask), axis=-1)
    centre = points.mean(axis=0)
    contour = outermost_pixels(mask, is_border_outside=True)
    min_iou = min(min_iou, _iou(1.0 - RASTER_OFFSET_PX * contour.sum() / len(points)))
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)]

    def iou(angle: float, offset: float) -> float:
        return _iou(_mirrored_share(points, centre, angle, offset, mask))

    # Local maxima over the angle, for axes through the centroid.
    seeds = np.radians(np.arange(0.0, 180.0, SEED_STEP_DEG))
    scores = np.array([iou(angle, 0.0) for angle in seeds])
    is_peak = (scores >= np.roll(scores, 1)) & (scores >= np.roll(scores, -1))
    is_peak &= scores >= min_iou - SEED_IOU_MARGIN
    axes = []
    for seed in seeds[is_peak]:
        steps = (float(np.radians(SEED_STEP_DEG / 2)), 1.0)
        (angle, offset), _ = refined_place(iou, (float(seed), 0.0), steps, float(np.radians(FINAL_STEP_DEG)))
        normal = np.array([np.cos(angle), np.sin(angle)])
        axes.append(ReflectionAxis(centre + offset * normal, normal, iou(angle, offset)))
    return sorted((axis for axis in axes if axis.iou >= min_iou), key=lambda axis: -axis.iou)[:MAX_AXES]


def refined_place(
    score: Callable[[float, float], float], place: tuple[float, float], steps: tuple[float, float], last_turn: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Search the best score near a place, an angle and another number, until the angle's step is at most `last_turn`.

    Steps are halved where no neighbour is better. Returns the place and the steps at the end.
    """
    (angle, offset), (turn, shift) = place, steps
    best = score(angle, offset)
    while turn > last_turn:
        neighbours = [(angle + i * turn, offset + j * shift) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        values = [score(*neighbour) for neighbour in neighbours]
        if max(values) > best + 1e-6:
            best = max(values)
            angle, offset = neighbours[values.index(best)]
        else:
            turn, shift = turn / 2, shift / 2
    return (angle, offset), (turn, shift)


def _iou(share: float) -> float:
    """Return the intersection over union of a silhouette and its mirror image, which share this much of its area."""
    # Both have the same area, so the union is twice it less the intersection.
    return share / (2.0 - share)


@njit(cache=True, nogil=True)
def _mirrored_share(points: np.ndarray, centre: np.ndarray, angle: float, offset: float, mask: np.ndarray) -> float:
    """Return the share of points (N, 2), camera frame, whose mirror images lie in a mask (H, W) bool.

    centre: (2,); angle: of the axis' normal, radians; offset: of the axis from the centre along it, in pixels.
    """
    height, width = mask.shape
    x, y = np.cos(angle), np.sin(angle)
    within = 0
    for point in range(len(points)):
        beyond = (points[point, 0] - centre[0]) * x + (points[point, 1] - centre[1]) * y - offset
        column = int(np.rint(points[point, 0] - 2.0 * beyond * x + (width - 1) / 2))
        row = int(np.rint((height - 1) / 2 - points[point, 1] + 2.0 * beyond * y))
        within += 0 <= column < width and 0 <= row < height and mask[row, column]
    return within / len(points)
