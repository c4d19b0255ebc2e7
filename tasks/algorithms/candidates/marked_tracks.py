"""Tracks of all marks between their keyframes ("automatic tracking technique", section 4.1 of Yeung et al. 2009).

Each marked highlight is followed towards the neighbouring keyframes; where a true and a false track meet, neither
counts.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.candidates.markup import Mark, Marks
from glint.tasks.algorithms.candidates.tracking import (
    CLICK_RADIUS_PX,
    MAX_TRACK_FRAMES,
    FrameReader,
    follow_highlight,
)

Follower = Callable[[Mark, slice], Iterable[tuple[int, int, int]]]
"""Gives row, column and frame of a mark's highlight over a span of frames."""
CONFLICT_RADIUS_PX, CONFLICT_RADIUS_DEG = 1, 3.0
"""Distance of pixels and angle of half vectors within which a true and a false mark contradict each other."""


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Position of a highlight in a frame, in pixels of the region; mark: its index."""

    row: int
    column: int
    frame: int
    mark: int


@dataclass(frozen=True, slots=True)
class Tracks:
    """Marks with their tracks.

    conflicts: messages about true and false tracks that met, both excluded there. warnings: messages about marks
    without a highlight. points: of all tracks, also where they met.
    """

    marks: Marks
    conflicts: tuple[str, ...]
    warnings: tuple[str, ...]
    points: tuple[TrackPoint, ...] = ()

    def path(self, mark: int) -> list[TrackPoint]:
        """Return the points of one mark's track in the order of their frames."""
        return sorted((point for point in self.points if point.mark == mark), key=lambda point: point.frame)


def track(
    marks: Sequence[Mark],
    read: FrameReader,
    thresholds: np.ndarray,
    half_vectors: np.ndarray,
    mask: np.ndarray,
    origin: tuple[int, int] = (0, 0),
) -> Tracks:
    """Track each marked highlight from its keyframe towards the neighbouring keyframes.

    A highlight's centre is where the surface reflects the light's centre, so its pixel gets the frame's half vector as
    its normal. A track ends where the highlight dims, leaves the object, jumps, splits or merges. A highlight that is
    not single in its keyframe counts at the marked pixel alone.

    Args:
        marks: of all keyframes.
        read: the region's frames.
        thresholds: (H, W), luma above which a pixel is lit.
        half_vectors: (T, 3), NaN where the frame was rejected.
        mask: (H, W) bool of the object.
        origin: column and row of the region's first pixel in the full frame; messages give pixels of the full frame.

    Raises:
        ValueError: a mark lies beyond the frames.
    """

    def follow(mark: Mark, span: slice) -> Iterable[tuple[int, int, int]]:
        return follow_highlight(mark, span, read, thresholds, mask)

    return join_tracks(marks, follow, half_vectors, origin)


def join_tracks(marks: Sequence[Mark], follow: Follower, half_vectors: np.ndarray, origin: tuple[int, int]) -> Tracks:
    """Follow each marked highlight towards the neighbouring keyframes, and exclude where true and false ones meet.

    half_vectors: (T, 3), NaN where the frame was rejected; for the rest see `track`. follow: gives the highlight of a
    mark over a span of frames.

    Raises:
        ValueError: a mark lies beyond the frames.
    """
    keyframes = sorted({mark.frame for mark in marks})
    points: list[TrackPoint] = []
    warnings = []
    for number, mark in enumerate(marks):
        if not 0 <= mark.frame < len(half_vectors):
            raise ValueError(f"mark {number + 1} is at frame {mark.frame} of {len(half_vectors)}")
        before = max((frame for frame in keyframes if frame < mark.frame), default=-1)
        after = min((frame for frame in keyframes if frame > mark.frame), default=len(half_vectors))
        span = slice(max(before + 1, mark.frame - MAX_TRACK_FRAMES), min(after, mark.frame + MAX_TRACK_FRAMES + 1))
        mark_points = [
            TrackPoint(row, column, frame, number)
            for row, column, frame in follow(mark, span)
            if np.isfinite(half_vectors[frame, 0])
        ]
        if not mark_points:
            has_light = bool(np.isfinite(half_vectors[mark.frame, 0]))
            warnings.append(_warning(number, mark, origin, has_light))
        points += mark_points
    conflicts, excluded = _conflicts(points, marks, half_vectors, origin)
    kept = sorted({(p.row, p.column, p.frame, int(marks[p.mark].true)) for p in points if p not in excluded})
    if not kept:
        return Tracks(Marks.empty(), conflicts, tuple(warnings), tuple(points))
    table = np.array(kept, np.int32)
    tracked = Marks(table[:, :2], half_vectors[table[:, 2]].astype(np.float32), table[:, 3].astype(np.int8))
    return Tracks(tracked, conflicts, tuple(warnings), tuple(points))


def _warning(number: int, mark: Mark, origin: tuple[int, int], has_light: bool) -> str:
    reason = (
        f"has no highlight within {CLICK_RADIUS_PX:g} pixels" if has_light else "is at a frame whose light was rejected"
    )
    return f"mark {number + 1} ({_describe(mark, origin)}) {reason}: move or remove it"


def _describe(mark: Mark, origin: tuple[int, int]) -> str:
    kind = "true" if mark.true else "false"
    return f"{kind}, frame {mark.frame}, x {mark.x + origin[0]:g}, y {mark.y + origin[1]:g}"


def _conflicts(
    points: list[TrackPoint], marks: Sequence[Mark], half_vectors: np.ndarray, origin: tuple[int, int]
) -> tuple[tuple[str, ...], set[TrackPoint]]:
    """Find true and false tracks that claim neighbouring pixels for nearly one half vector.

    Returns:
        A message per pair of marks, and the points to exclude.
    """
    table = np.array([(p.row, p.column, p.frame, p.mark) for p in points]).reshape(-1, 4)
    is_true = np.array([marks[p.mark].true for p in points], bool)
    false = np.flatnonzero(~is_true)
    excluded: set[TrackPoint] = set()
    pairs: dict[tuple[int, int], list[TrackPoint]] = {}
    for index in np.flatnonzero(is_true):
        near = false[(np.abs(table[false, :2] - table[index, :2]) <= CONFLICT_RADIUS_PX).all(axis=1)]
        cosine = half_vectors[table[near, 2]] @ half_vectors[table[index, 2]]
        for opposite in near[cosine > np.cos(np.radians(CONFLICT_RADIUS_DEG))].tolist():
            excluded |= {points[index], points[opposite]}
            pairs.setdefault((points[index].mark, points[opposite].mark), []).append(points[index])
    messages = [
        f"marks {true + 1} ({_describe(marks[true], origin)}) and {not_true + 1}"
        f" ({_describe(marks[not_true], origin)}) meet at"
        f" x {met[0].column + origin[0]}, y {met[0].row + origin[1]} in frame {met[0].frame}:"
        " neither counts there; check them"
        for (true, not_true), met in pairs.items()
    ]
    return tuple(messages), excluded
