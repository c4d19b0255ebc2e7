"""Reflection symmetry axes of a silhouette, each of which may be the image of an axis of revolution.

Source: the score of a reflection is the overlap of the silhouette with its mirror image, maximized over angle and
offset (Marola 1989).
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera

MIN_SYMMETRY_IOU = 0.96
"""Intersection over union of a silhouette with its mirror image from which it counts as symmetric."""
SEED_IOU_MARGIN = 0.06
"""How far below that an unrefined angle may score."""
SEED_STEP_DEG, FINAL_STEP_DEG = 3.0, 0.1
"""Steps in angle of the exhaustive search, and at which refinement ends."""
MAX_SCORED_PIXELS = 4000
"""Pixels of the silhouette that are mirrored; of a larger one, every n-th."""


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


def reflection_axes(mask: np.ndarray, min_iou: float = MIN_SYMMETRY_IOU, count: int = 4) -> list[ReflectionAxis]:
    """Return up to `count` axes of a silhouette (H, W) bool with an overlap of at least `min_iou`, best first."""
    height, width = mask.shape
    rows, columns = np.nonzero(mask)
    points = np.stack(to_camera(columns.astype(float), rows.astype(float), width, height), axis=-1)
    centre = points.mean(axis=0)
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)]

    def iou(angle: float, offset: float) -> float:
        normal = np.array([np.cos(angle), np.sin(angle)])
        mirrored = points - 2.0 * np.outer((points - centre) @ normal - offset, normal)
        column = np.rint(mirrored[:, 0] + (width - 1) / 2).astype(int)
        row = np.rint((height - 1) / 2 - mirrored[:, 1]).astype(int)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        share = float((inside & mask[row.clip(0, height - 1), column.clip(0, width - 1)]).mean())
        # Both silhouettes have the same area, so the union is twice it less the intersection.
        return share / (2.0 - share)

    # Local maxima over the angle, for axes through the centroid.
    seeds = np.radians(np.arange(0.0, 180.0, SEED_STEP_DEG))
    scores = np.array([iou(angle, 0.0) for angle in seeds])
    is_peak = (scores >= np.roll(scores, 1)) & (scores >= np.roll(scores, -1)) & (scores >= min_iou - SEED_IOU_MARGIN)
    axes = []
    for seed in seeds[is_peak]:
        # Coordinate search over angle and offset, with steps that are halved where no neighbour is better.
        best, angle, offset = iou(seed, 0.0), float(seed), 0.0
        turn, shift = np.radians(SEED_STEP_DEG / 2), 1.0
        while turn > np.radians(FINAL_STEP_DEG):
            neighbours = [(angle + i * turn, offset + j * shift) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            values = [iou(*neighbour) for neighbour in neighbours]
            if max(values) > best + 1e-6:
                best = max(values)
                angle, offset = neighbours[values.index(best)]
            else:
                turn, shift = turn / 2, shift / 2
        normal = np.array([np.cos(angle), np.sin(angle)])
        axes.append(ReflectionAxis(centre + offset * normal, normal, best))
    return sorted((axis for axis in axes if axis.iou >= min_iou), key=lambda axis: -axis.iou)[:count]
