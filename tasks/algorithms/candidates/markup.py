"""Highlights that the user marked as true or false, and the constraints that follow from them.

Sources in Yeung et al. 2009: true marks constrain the initial normals (section 4.1), and marks fix the labels of their
nodes (the sets F and C of Eqn 2).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit

MARK_RADIUS_DEG = 6.0
"""Angle within which a candidate belongs to a mark, degrees: a candidate's spread and the error of half vectors."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Highlight marked in a frame.

    x, y: in pixels of the region. true: it is reflected by the exterior surface.
    """

    frame: int
    x: float
    y: float
    true: bool


@dataclass(frozen=True, slots=True)
class Marks:
    """Pixels of marked and tracked highlights.

    pixels: (N, 2) int32 (row, column). half_vectors: (N, 3) float32. kind: (N,) int8, 1 true, 0 false.
    """

    pixels: np.ndarray
    half_vectors: np.ndarray
    kind: np.ndarray

    @classmethod
    def empty(cls) -> "Marks":
        """Return no marks."""
        return cls(np.zeros((0, 2), np.int32), np.zeros((0, 3), np.float32), np.zeros(0, np.int8))


class MarkConstraints(NamedTuple):
    """Constraints of marks on pixels and on their clusters.

    pixels (H, W) bool: those with a true mark. normals (H, W, 3): theirs, NaN elsewhere. labels (K, H, W) int8: of the
    clusters, 1 exterior, -1 false, 0 free.
    """

    pixels: np.ndarray
    normals: np.ndarray
    labels: np.ndarray


def mark_constraints(
    marks: Marks | None, normals: np.ndarray, mask: np.ndarray, exterior: np.ndarray | None = None
) -> MarkConstraints:
    """Return the constraints of marks on pixels and on their clusters.

    A mark fixes one cluster of its pixel within MARK_RADIUS_DEG of its half vector: where two sheets cross, it is of
    one of them, rather of one whose label it confirms, else of the nearest. Of several marks of one cluster the nearest
    fixes it. A true mark also rules out the clusters beyond twice that angle that no mark fixes. Several true marks of
    one pixel are averaged.

    Args:
        marks: None for no marks.
        normals: (K, H, W, 3) of the clusters.
        mask: (H, W) bool; marks outside are ignored.
        exterior: (K, H, W) bool, clusters that are labelled exterior without the marks; None: not labelled yet.
    """
    marked, sums = np.zeros(mask.shape, dtype=bool), np.zeros((*mask.shape, 3), np.float32)
    labels = np.zeros(normals.shape[:3], dtype=np.int8)
    if marks is None:
        return MarkConstraints(marked, unit(sums), labels)
    nearest, is_ruled_out = np.full(labels.shape, -1.0), np.zeros(labels.shape, dtype=bool)
    for (row, column), half_vector, kind in zip(marks.pixels, marks.half_vectors, marks.kind, strict=True):
        if not mask[row, column]:
            continue
        cosine = normals[:, row, column] @ half_vector
        near = cosine > np.cos(np.radians(MARK_RADIUS_DEG))
        if exterior is not None:
            confirmed = near & (exterior[:, row, column] == (kind == 1))
            near = confirmed if confirmed.any() else near
        fixed = near & (cosine == np.max(cosine, where=near, initial=-1.0)) & (cosine > nearest[:, row, column])
        nearest[fixed, row, column] = cosine[fixed]
        labels[fixed, row, column] = 1 if kind == 1 else -1
        if kind == 1:
            marked[row, column] = True
            sums[row, column] += half_vector
            is_ruled_out[:, row, column] |= cosine < np.cos(np.radians(2.0 * MARK_RADIUS_DEG))
    labels = np.where(is_ruled_out & (labels == 0), -1, labels).astype(np.int8)
    return MarkConstraints(marked, unit(sums), labels)
