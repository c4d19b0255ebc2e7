"""Markup: highlights that the user marked as true or false, tracked between keyframes."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from glint.storage.catalogue.models import Region
from glint.storage.inputs.markup import AnnotationEntry, read_markup
from glint.storage.versions.stage_results import StageResult
from glint.tasks.algorithms.candidates.marked_tracks import Tracks, track
from glint.tasks.algorithms.candidates.markup import Mark, Marks
from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_to_view
from glint.tasks.algorithms.near_light.positions import NearLight
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import OBJECT, CaptureGeometry, load_geometry
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
    cache, region = open_frames(inputs), load_geometry(inputs).region
    entries = read_markup(address, cache.frame_size, cache.frames, region, inputs.load("mask").read("mask"))
    tracks = track_entries(inputs, entries)
    return StageOutput(
        arrays=_arrays(tracks.marks),
        counts={"marks": len(entries), "marked pixels": len(tracks.marks.kind)},
        warnings=[StageWarning(message, "marks") for message in (*tracks.conflicts, *tracks.warnings)],
    )


def track_entries(results: CaptureResults, entries: Sequence[AnnotationEntry]) -> Tracks:
    """Track annotations of a capture; half vectors are those of their pixels, corrected for light and camera."""
    cache, geometry = open_frames(results), load_geometry(results)
    region, mask = geometry.region, results.load("mask").read("mask")
    marks = marks_in_region(entries, region)
    thresholds = results.load("thresholds").read("thresholds")
    half_vectors = results.load("lights").read("half_vectors")
    tracks = track(marks, partial(cache.read, OBJECT), thresholds, half_vectors, mask, (region.x, region.y))
    return corrected_tracks(tracks, load_near_light(results), geometry)


def corrected_tracks(tracks: Tracks, near_light: NearLight | None, geometry: CaptureGeometry) -> Tracks:
    """Return tracks whose marks have half vectors as seen at their pixels."""
    marks = tracks.marks
    if not len(marks.kind):
        return tracks
    seen_at = corrected(marks.half_vectors, marks.pixels, near_light, geometry)
    return replace(tracks, marks=replace(marks, half_vectors=seen_at))


def marks_in_region(entries: Sequence[AnnotationEntry], region: Region) -> list[Mark]:
    """Return annotations, which are in pixels of the full frame, as marks in pixels of the region."""
    return [Mark(entry.frame, entry.x - region.x, entry.y - region.y, entry.kind == "true") for entry in entries]


def corrected(
    half_vectors: np.ndarray, pixels: np.ndarray, near_light: NearLight | None, geometry: CaptureGeometry
) -> np.ndarray:
    """Return half vectors (N, 3) as seen at pixels (N, 2) of the region, by the near light and the camera."""
    rows, columns = pixels.T
    if near_light is not None:
        half_vectors = near_light.half_vectors_at(half_vectors, columns + geometry.region.x, rows + geometry.region.y)
    if geometry.view_vectors is not None:
        half_vectors = half_vectors_for_view(half_vectors, geometry.view_vectors[tuple(pixels.T)])
    return half_vectors


def load_marks(results: CaptureResults) -> Marks | None:
    """Load the marks that were saved; None where nothing is marked."""
    return tracked_marks(results.load("markup"))


def tracked_marks(saved: StageResult) -> Marks | None:
    """Read the marks of a result of the stage; None where nothing is marked."""
    marks = Marks(saved.read("pixels"), saved.read("half_vectors"), saved.read("kind"))
    return marks if len(marks.kind) else None


def faced_marks(marks: Marks | None, view: np.ndarray | None) -> Marks | None:
    """Return marks as seen along view vectors (H, W, 3); None: an orthographic camera's, unchanged."""
    if marks is None or view is None:
        return marks
    return replace(marks, half_vectors=rotate_to_view(marks.half_vectors, view[tuple(marks.pixels.T)]))


def _arrays(marks: Marks) -> dict[str, np.ndarray]:
    return {"pixels": marks.pixels, "half_vectors": marks.half_vectors, "kind": marks.kind}
