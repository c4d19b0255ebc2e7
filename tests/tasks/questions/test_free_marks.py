"""Marks that a person sets freely, beside marks that say nothing."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from glint.storage.errors import InputError
from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.questions.capture_questions import CaptureQuestions
from glint.tasks.questions.free_marks import (
    MAX_STROKE_MARKS,
    SAME_SHEET_DEG,
    STROKE_SPACING_PX,
    highlights_along,
    highlights_at,
    refusal,
)
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


def crossing(held: CaptureQuestions) -> list[tuple[int, int]]:
    """Return the pixels of a line across the object, through the middle of its candidates."""
    row = int(np.argwhere(held.candidate_pixels)[:, 0].mean())
    return [(row, int(column)) for column in np.flatnonzero(held.mask[row])]


def test_a_line_over_all_frames_marks_one_sheet_at_its_spacing(held: CaptureQuestions) -> None:
    line = highlights_along(held, None, crossing(held))
    columns = [highlight.column for highlight in line]
    assert 1 < len(line) <= MAX_STROKE_MARKS and (np.diff(columns) >= STROKE_SPACING_PX).all()
    normals = np.array([held.clusters.normals[item.layer, item.row, item.column] for item in line])
    assert (angles(normals[1:], normals[:-1]) < SAME_SHEET_DEG * np.diff(columns)).all()
    for highlight in line:
        assert held.frames.lit_at(highlight.row, highlight.column).tolist().count(highlight.frame) == 1


def test_a_line_in_a_frame_marks_each_of_its_highlights_once(held: CaptureQuestions) -> None:
    points = crossing(held)
    frame = next(int(lit[0]) for point in points if len(lit := held.frames.lit_at(*point)))
    line = highlights_along(held, frame, [*points, *reversed(points)])
    places = [(highlight.row, highlight.column) for highlight in line]
    assert {highlight.frame for highlight in line} == {frame} and len(set(places)) == len(places) <= MAX_STROKE_MARKS
    levels = held.frames.levels_of_frame(frame)
    assert all(levels[place] > held.frames.thresholds[place] for place in places)


def test_a_line_beside_the_object_names_its_first_point(held: CaptureQuestions) -> None:
    x, y = held.frame_position(0, 0)
    for frame in (None, int(np.flatnonzero(np.isfinite(held.frames.half_vectors[:, 0]))[0])):
        with pytest.raises(InputError, match=f"of x {x}, y {y} in"):
            highlights_along(held, frame, [(0, 0), (0, 1)])
