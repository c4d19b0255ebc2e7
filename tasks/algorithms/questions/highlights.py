"""The highlight that stands for a sheet: a pixel in the sheet's middle, and the frame in which it is brightest."""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.distance import depth_inside
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.questions.proposals import Question

TRIED_PIXELS = 12
"""Pixels of a sheet, from its middle outwards, in which a lit frame is looked for."""

LevelsReader = Callable[[int, int], np.ndarray]
"""Reads the levels (T,) of a pixel at a row and column of the region."""
HalfVectors = Callable[[int, int], np.ndarray]
"""Returns the half vectors (T, 3) of all frames at a row and column of the region, NaN without a light."""


def choose_highlight(
    question: Question,
    normals: np.ndarray,
    thresholds: np.ndarray,
    read_levels: LevelsReader,
    half_vectors: HalfVectors,
    radius_deg: float,
) -> tuple[int, int, int] | None:
    """Choose frame, row and column of the highlight by which a question is asked; None if no frame shows the sheet.

    Args:
        question: the sheet.
        normals: (K, H, W, 3), the candidates that it is a part of.
        thresholds: (H, W), luma above which a pixel is lit.
        read_levels, half_vectors: of a pixel in all frames.
        radius_deg: angle between a frame's half vector and a sheet's normal within which the frame shows the sheet,
            degrees: the light's disc of half vectors, as in the clusters.
    """
    footprint = np.zeros(thresholds.shape, dtype=bool)
    footprint[question.rows, question.columns] = True
    depth = depth_inside(footprint)
    order = np.argsort(-depth[question.rows, question.columns], kind="stable")
    for node in order[np.linspace(0, len(order) - 1, min(TRIED_PIXELS, len(order))).astype(int)]:
        layer, row, column = (int(index[node]) for index in (question.layers, question.rows, question.columns))
        angle = angles(half_vectors(row, column), normals[layer, row, column])
        lit = read_levels(row, column) > thresholds[row, column]
        shown = np.flatnonzero(lit & (angle < radius_deg))
        if len(shown):
            # A highlight is brightest where the half vector is the normal, and clipped around it.
            return int(shown[np.argmin(angle[shown])]), row, column
    return None
