"""The highlight that stands for a sheet."""

import numpy as np

from glint.tasks.algorithms.questions.highlights import choose_highlight
from glint.tasks.algorithms.questions.proposals import Question


def test_the_highlight_lies_in_the_middle_at_the_frame_nearest_to_the_normal() -> None:
    normals = np.full((1, 9, 9, 3), np.nan, np.float32)
    rows, columns = (index.ravel() for index in np.mgrid[2:7, 2:7])
    normals[0, rows, columns] = (0.0, 0.0, 1.0)
    question = Question(np.zeros(25, int), rows, columns, True, 0.5, 1.0)
    tilts = np.radians([8.0, 1.5, 0.5, np.nan, 0.2])
    half_vectors = np.stack([np.sin(tilts), 0 * tilts, np.cos(tilts)], axis=-1)
    levels = np.array([200, 200, 200, 200, 10])

    def choose(bright: np.ndarray, radius_deg: float = 2.2) -> tuple[int, int, int] | None:
        thresholds = np.full((9, 9), 100)
        return choose_highlight(question, normals, thresholds, lambda *_: bright, lambda *_: half_vectors, radius_deg)

    assert choose(levels) == (2, 4, 4)
    first_alone = np.where(np.arange(5) == 0, 200, 0)
    assert choose(first_alone) is None
    assert choose(first_alone, radius_deg=9.0) == (0, 4, 4)
