"""Marks that a person sets freely, beside marks that say nothing."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.questions.capture_questions import CaptureQuestions
from glint.tasks.questions.free_marks import highlights_at, refusal
from tests.tasks.make_context import make_context


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory, simulated: Path, performed: Path) -> CaptureQuestions:
    store = tmp_path_factory.mktemp("marks") / "store"
    shutil.copytree(performed, store)
    return CaptureQuestions(make_context(simulated, store))


def test_a_mark_without_a_highlight_contradicts_nothing(held: CaptureQuestions) -> None:
    row, column = (int(index) for index in np.argwhere(held.candidate_pixels).mean(axis=0))
    highlight = highlights_at(held, row, column)[0]
    x, y = held.frame_position(0, 0)
    beside_the_object = AnnotationEntry(frame=highlight.frame, x=float(x), y=float(y), kind="true")
    assert not held.frames.tracks((beside_the_object,)).points
    assert refusal(held, highlight, "true", (beside_the_object,)) is None
