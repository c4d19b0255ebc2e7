"""The labelling of the last run stands for the marks that it knew, and for no others."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.questions.capture_questions import CaptureQuestions
from glint.tasks.stages.markup import load_marks
from tests.tasks.make_context import make_context, perform_all


@pytest.mark.usefixtures("smooth_labels")
def test_stored_labels_are_those_of_the_same_marks(simulated: Path, performed: Path, tmp_path: Path) -> None:
    shutil.copytree(performed, tmp_path / "store")
    folder = Path(str(load(simulated).objects[0].captures[0].mask)).parent
    work = make_context(simulated, tmp_path / "store", markup=str(folder / "markup.json"))
    perform_all(work, "labels")
    held, marks = CaptureQuestions(work), load_marks(work)
    assert marks is not None
    stored = held.stored_labels(marks)
    assert stored is not None and np.array_equal(stored.labels, work.load("labels").read("labels"))
    assert held.stored_labels(None) is None
    # The same pixels, marked in frames with other lights.
    in_other_frames = replace(marks, half_vectors=unit(marks.half_vectors + np.array([0.1, 0.0, 0.0], np.float32)))
    assert held.stored_labels(in_other_frames) is None
