"""Markup: highlights that the user marked as true or false, tracked between keyframes."""

from dataclasses import replace
from functools import partial

import numpy as np

from glint.storage.inputs.masks_and_truth import read_markup
from glint.tasks.algorithms.candidates.markup import Mark, Marks
from glint.tasks.algorithms.candidates.tracking import track
from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_to_view
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import OBJECT, bars_of, open_frames, region_of, views_of
from glint.tasks.stages.lights import near_lamp_of


def markup(work: Workspace, progress: Progress) -> Outcome:
    """Pixels, half vectors and kinds of the marks and their tracks; none without markup.

    Raises:
        InputError: the markup is malformed or lies outside the object.
    """
    if work.capture.markup is None:
        return Outcome(arrays=_arrays(Marks.empty()))
    cache, region = open_frames(work), region_of(work)
    mask = work.load("mask").read("mask")
    said = read_markup(work.capture.markup, cache.frame_size, cache.frames, region, mask)
    marks = [Mark(each.frame, each.x - region.x, each.y - region.y, each.kind == "true") for each in said]
    bars, half_vectors = bars_of(work, cache, mask), work.load("lights").read("half_vectors")
    tracks = track(marks, partial(cache.read, OBJECT), bars, half_vectors, mask, (region.x, region.y))
    found, lamp = tracks.marks, near_lamp_of(work)
    if lamp is not None and len(found.kind):
        rows, columns = found.pixels.T
        found = replace(
            found, half_vectors=lamp.half_vectors_at(found.half_vectors, columns + region.x, rows + region.y)
        )
    view = views_of(work)
    if view is not None and len(found.kind):
        found = replace(found, half_vectors=half_vectors_for_view(found.half_vectors, view[tuple(found.pixels.T)]))
    return Outcome(
        arrays=_arrays(found),
        counts={"marks": len(marks), "marked pixels": len(tracks.marks.kind)},
        warnings=[*tracks.conflicts, *tracks.warnings],
    )


def load_marks(work: Workspace) -> Marks | None:
    """What was saved; None where nothing is marked."""
    saved = work.load("markup")
    marks = Marks(saved.read("pixels"), saved.read("half_vectors"), saved.read("kind"))
    return marks if len(marks.kind) else None


def faced_marks(marks: Marks | None, view: np.ndarray) -> Marks | None:
    """Marks as seen along view vectors (H, W, 3)."""
    if marks is None:
        return None
    return replace(marks, half_vectors=rotate_to_view(marks.half_vectors, view[tuple(marks.pixels.T)]))


def _arrays(marks: Marks) -> dict[str, np.ndarray]:
    return {"pixels": marks.pixels, "half_vectors": marks.half_vectors, "kind": marks.kind}
