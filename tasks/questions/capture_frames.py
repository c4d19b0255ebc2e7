"""Frames of a stored capture, read where a person looks: levels of a pixel, levels of a frame, tracks of highlights."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from glint.storage.errors import InputError
from glint.storage.frames.layout import CHUNK_PX
from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.candidates.marked_tracks import Tracks, join_tracks
from glint.tasks.algorithms.candidates.markup import Mark, Marks
from glint.tasks.algorithms.candidates.tracking import follow_highlight
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.stages.capture_geometry import OBJECT, CaptureGeometry
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.light_distance import load_near_light
from glint.tasks.stages.markup import corrected, corrected_tracks, marks_in_region
from glint.tasks.stages.wall_distance import half_vectors_with_distance, marks_with_distance

KEPT_BLOCKS = 8
"""Parts of the frames that are kept for the next highlight."""


class CaptureFrames:
    """The frames of a capture's object, which of its pixels each lights, and from where; what was read is kept."""

    def __init__(self, work: CaptureContext, geometry: CaptureGeometry, mask: np.ndarray) -> None:
        """Open the frames; geometry and mask (H, W): of the capture.

        Raises:
            StoreError: the capture was not run.
        """
        self.geometry, self.mask = geometry, mask
        self.thresholds: np.ndarray = work.load("thresholds").read("thresholds")
        self.half_vectors: np.ndarray = work.load("lights").read("half_vectors")
        self._near_light = load_near_light(work)
        self._distance_change: float = work.load("labels").record["inverse_distance_change"]
        self.cache = open_frames(work)
        self.levels = lru_cache(maxsize=64)(self._read_levels)
        self.levels_of_frame = lru_cache(maxsize=8)(self._read_frame)
        self.tracks = lru_cache(maxsize=64)(self._track)
        self._blocks = lru_cache(maxsize=KEPT_BLOCKS)(self._read_blocks)
        self._followed = lru_cache(maxsize=1024)(self._follow)

    def lit_at(self, row: int, column: int) -> np.ndarray:
        """Return the frames with a light in which a pixel of the region is lit, ascending."""
        lit = self.levels(row, column) > self.thresholds[row, column]
        return np.flatnonzero(lit & np.isfinite(self.half_vectors[:, 0]))

    def half_vectors_of(self, row: int, column: int) -> np.ndarray:
        """Return the half vectors (T, 3) of the frames as seen at a pixel of the region."""
        pixels = np.tile(np.array([[row, column]]), (len(self.half_vectors), 1))
        seen_at = corrected(self.half_vectors, pixels, self._near_light, self.geometry)
        return half_vectors_with_distance(seen_at, pixels, self.geometry, self._distance_change)

    def marks(self, annotations: list[AnnotationEntry]) -> Marks | None:
        """Return annotations and their tracks as marks; None where there are none."""
        marks = self.tracks(tuple(annotations)).marks
        return marks if len(marks.kind) else None

    def _track(self, annotations: tuple[AnnotationEntry, ...]) -> Tracks:
        late = [item.frame for item in annotations if item.frame >= len(self.half_vectors)]
        if late:
            raise InputError(f"a mark is at frame {late[0]:,}", f"the last one is {len(self.half_vectors) - 1:,}")
        region = self.geometry.region
        tracks = join_tracks(
            marks_in_region(annotations, region),
            lambda mark, span: self._followed(mark.frame, mark.x, mark.y, span.start, span.stop),
            self.half_vectors,
            (region.x, region.y),
        )
        tracks = corrected_tracks(tracks, self._near_light, self.geometry)
        return replace(tracks, marks=marks_with_distance(tracks.marks, self.geometry, self._distance_change))

    def _follow(self, frame: int, x: float, y: float, start: int, stop: int) -> list[tuple[int, int, int]]:
        span = slice(start, stop)
        return list(follow_highlight(Mark(frame, x, y, True), span, self._window, self.thresholds, self.mask))

    def _window(self, frames: slice, rows: slice, columns: slice) -> np.ndarray:
        """Read a part of the frames out of whole chunks of the cache, which neighbouring highlights share."""
        parts, chunk = (frames, rows, columns), (self.cache.shard_frames, CHUNK_PX, CHUNK_PX)
        starts = [part.start // size * size for part, size in zip(parts, chunk, strict=True)]
        ends = [-(-part.stop // size) * size for part, size in zip(parts, chunk, strict=True)]
        inner = (slice(part.start - start, part.stop - start) for part, start in zip(parts, starts, strict=True))
        return np.asarray(self._blocks(*zip(starts, ends, strict=True))[tuple(inner)])

    def _read_frame(self, frame: int) -> np.ndarray:
        return np.asarray(self.cache.read(OBJECT, slice(frame, frame + 1))[0])

    def _read_levels(self, row: int, column: int) -> np.ndarray:
        pixel = slice(row, row + 1), slice(column, column + 1)
        return np.asarray(self.cache.read(OBJECT, rows=pixel[0], columns=pixel[1])[:, 0, 0])

    def _read_blocks(self, *whole: tuple[int, int]) -> np.ndarray:
        return self.cache.read(OBJECT, *(slice(start, end) for start, end in whole))
