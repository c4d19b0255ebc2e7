"""Answer the questions view about marks set freely: the highlight that is meant, refusals in words, tracks."""

from collections.abc import Sequence
from typing import Any

from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.candidates.marked_tracks import TrackPoint
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.questions.capture_questions import CaptureQuestions, ShownQuestion
from glint.tasks.questions.free_marks import (
    Highlight,
    highlight_in_frame,
    highlights_along,
    highlights_at,
    refusal,
)
from glint.tasks.questions.loops import facts_of
from glint.tasks.review.questions import mark_authors, saved_marks, session_of

KINDS = ("true", "false")


def meant_highlights(context: CaptureContext, frame: int | None, points: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """Return what a click or a drawn line means, as JSON values: `choices`, of which a person labels one.

    frame: the one that is shown, None: a picture of all frames. points: pixels (x, y) of the full frame, one for a
    click. A choice has `highlights` (frame, x, y, `track`), the facts of a question (without `wrong`) about its first
    one, and `refused`: for `true` and `false` the reason why they cannot be marked so, None: they can.

    Raises:
        InputError: it has not run yet, the pixel lies outside the region, or there is no highlight near; StoreError:
            the store cannot be read.
    """
    session, (revision, marks) = session_of(context), saved_marks(context)
    held, geometry = session.questions, session.questions.geometry
    # A line may leave the region after its first point.
    inside = [points[0], *(point for point in points[1:] if geometry.holds(*point))]
    pixels = [geometry.row_and_column(x, y) for x, y in inside]
    with session.marking_lock:
        if len(pixels) > 1:
            groups = [highlights_along(held, frame, pixels)]
        elif frame is not None:
            groups = [[highlight_in_frame(held, frame, *pixels[0])]]
        else:
            groups = [[highlight] for highlight in highlights_at(held, *pixels[0])]
        return {"revision": revision, "choices": [_choice(held, group, marks) for group in groups]}


def mark_tracks(context: CaptureContext) -> dict[str, Any]:
    """Return the saved marks with their authors (None: the catalogue has them), their tracks (frame, x, y) in the full
    frame, and what contradicts them, as JSON.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    session, (revision, marks) = session_of(context), saved_marks(context)
    held = session.questions
    with session.marking_lock:
        tracks = held.frames.tracks(marks)
    authors = mark_authors(context, revision)
    return {
        "revision": revision,
        "marks": [
            mark.model_dump() | {"author": authors.get(mark), "track": _path(held, tracks.path(number))}
            for number, mark in enumerate(marks)
        ],
        "problems": [*tracks.conflicts, *tracks.warnings],
    }


def _choice(held: CaptureQuestions, group: list[Highlight], marks: tuple[AnnotationEntry, ...]) -> dict[str, Any]:
    """Return a group of highlights that a click may mean as the page shows it: its sheet, and why it may be refused."""
    first = group[0]
    layer = first.layer if first.layer is not None else 0
    question = held.sheet_of(layer, first.row, first.column)
    x, y = held.frame_position(first.row, first.column)
    facts = facts_of(held, ShownQuestion(question, first.frame, x, y))
    del facts["wrong"]
    if first.layer is None:
        facts |= {"sheet": [], "accepted": None}
    return facts | {
        "highlights": [_facts(held, item) for item in group],
        "refused": {kind: _refusal(held, group, kind, marks) for kind in KINDS},
    }


def _refusal(
    held: CaptureQuestions, group: list[Highlight], kind: str, marks: tuple[AnnotationEntry, ...]
) -> str | None:
    """Return the first reason why a highlight of a group cannot be marked so, None where all of them can."""
    reasons = (refusal(held, highlight, kind, marks) for highlight in group)
    return next((reason for reason in reasons if reason is not None), None)


def _facts(held: CaptureQuestions, highlight: Highlight) -> dict[str, Any]:
    x, y = held.frame_position(highlight.row, highlight.column)
    return {"frame": highlight.frame, "x": x, "y": y, "track": _path(held, highlight.track)}


def _path(held: CaptureQuestions, points: Sequence[TrackPoint]) -> list[list[int]]:
    return [[point.frame, *held.frame_position(point.row, point.column)] for point in points]
