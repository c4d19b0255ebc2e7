"""Mirror axes of a silhouette: each may be the image of an axis of revolution."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera

LEAST_OVERLAP = 0.96
"""Intersection over union of a silhouette with its mirror image from which it counts as symmetric."""


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A mirror axis of a silhouette: a point (2,) of it in the camera frame, the direction (2,) across it, the overlap
    of the silhouette and its mirror image."""

    point: np.ndarray
    across: np.ndarray
    overlap: float

    @property
    def along(self) -> np.ndarray:
        """Direction (2,) of the axis."""
        return np.array([-self.across[1], self.across[0]])


def mirror_axes(mask: np.ndarray, least: float = LEAST_OVERLAP, most: int = 4) -> list[Axis]:
    """Mirror axes of a silhouette (H, W) bool, the best first; none where it is not symmetric."""
    height, width = mask.shape
    rows, columns = np.nonzero(mask)
    points = np.stack(to_camera(columns.astype(float), rows.astype(float), width, height), axis=-1)
    centre = points.mean(axis=0)
    points = points[:: max(1, len(points) // 4000)]

    def overlap(angle: float, offset: float) -> float:
        across = np.array([np.cos(angle), np.sin(angle)])
        mirrored = points - 2.0 * np.outer((points - centre) @ across - offset, across)
        column = np.rint(mirrored[:, 0] + (width - 1) / 2).astype(int)
        row = np.rint((height - 1) / 2 - mirrored[:, 1]).astype(int)
        there = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        share = float((there & mask[row.clip(0, height - 1), column.clip(0, width - 1)]).mean())
        return share / (2.0 - share)

    tried = np.radians(np.arange(0.0, 180.0, 3.0))
    coarse = np.array([overlap(angle, 0.0) for angle in tried])
    peaks = (coarse >= np.roll(coarse, 1)) & (coarse >= np.roll(coarse, -1)) & (coarse >= least - 0.06)
    found = []
    for start in tried[peaks]:
        best, angle, offset = overlap(start, 0.0), float(start), 0.0
        turn, shift = np.radians(1.5), 1.0
        while turn > np.radians(0.1):
            near = [(angle + i * turn, offset + j * shift) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            values = [overlap(*each) for each in near]
            if max(values) > best + 1e-6:
                best = max(values)
                angle, offset = near[values.index(best)]
            else:
                turn, shift = turn / 2, shift / 2
        across = np.array([np.cos(angle), np.sin(angle)])
        found.append(Axis(centre + offset * across, across, best))
    return sorted((each for each in found if each.overlap >= least), key=lambda each: -each.overlap)[:most]
