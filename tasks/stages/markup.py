"""Markup: highlights that the user marked as true or false, tracked between keyframes."""

from dataclasses import replace
from functools import partial

import numpy as np

from glint.storage.inputs.markup import read_markup
from glint.tasks.algorithms.candidates.markup import Mark, Marks
from glint.tasks.algorithms.candidates.tracking import track
from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_to_view
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import OBJECT, load_geometry
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.light_distance import load_near_light


def markup(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Track the marks: pixels, half vectors and kinds of the marks and their tracks; none without markup.

    Raises:
        InputError: the markup is malformed or lies outside the object.
    """
    address = inputs.file("markup")
    if address is None:
        return StageOutput(arrays=_arrays(Marks.empty()))
    cache, geometry = open_frames(inputs), load_geometry(inputs)
    region, mask = geometry.region, inputs.load("mask").read("mask")
    entries = read_markup(address, cache.frame_size, cache.frames, region, mask)
    marks = [Mark(entry.frame, entry.x - region.x, entry.y - region.y, entry.kind == "true") for entry in entries]
    thresholds = inputs.load("thresholds").read("thresholds")
    half_vectors = inputs.load("lights").read("half_vectors")
    tracks = track(marks, partial(cache.read, OBJECT), thresholds, half_vectors, mask, (region.x, region.y))
    tracked, near_light = tracks.marks, load_near_light(inputs)
    if near_light is not None and len(tracked.kind):
        rows, columns = tracked.pixels.T
        vectors = near_light.half_vectors_at(tracked.half_vectors, columns + region.x, rows + region.y)
        tracked = replace(tracked, half_vectors=vectors)
    view = geometry.view_vectors
    if view is not None and len(tracked.kind):
        tracked = replace(
            tracked, half_vectors=half_vectors_for_view(tracked.half_vectors, view[tuple(tracked.pixels.T)])
        )
    return StageOutput(
        arrays=_arrays(tracked),
        counts={"marks": len(marks), "marked pixels": len(tracks.marks.kind)},
        warnings=[StageWarning(message, "marks") for message in (*tracks.conflicts, *tracks.warnings)],
    )


def load_marks(results: CaptureResults) -> Marks | None:
    """Load the marks that were saved; None where nothing is marked."""
    saved = results.load("markup")
    marks = Marks(saved.read("pixels"), saved.read("half_vectors"), saved.read("kind"))
    return marks if len(marks.kind) else None


def faced_marks(marks: Marks | None, view: np.ndarray) -> Marks | None:
    """Return marks as seen along view vectors (H, W, 3)."""
    if marks is None:
        return None
    return replace(marks, half_vectors=rotate_to_view(marks.half_vectors, view[tuple(marks.pixels.T)]))


def _arrays(marks: Marks) -> dict[str, np.ndarray]:
    return {"pixels": marks.pixels, "half_vectors": marks.half_vectors, "kind": marks.kind}
