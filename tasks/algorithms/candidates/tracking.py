"""Tracking of marked highlights between keyframes ("automatic tracking technique", section 4.1 of Yeung et al. 2009).

Bright blobs of a frame are associated with those of the next by nearest neighbour about a predicted position (constant
velocity), and tracks end wherever blobs may have merged or split.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.candidates.blob_shape import blob_centre, is_single_highlight
from glint.tasks.algorithms.candidates.markup import Mark, Marks

FrameReader = Callable[[slice, slice, slice], np.ndarray]
"""Reads frames, rows and columns of the region as an array (T, h, w)."""
Point = tuple[float, float]
"""Position x, y in pixels."""
MAX_TRACK_FRAMES = 64
"""Frames before and after its keyframe over which a mark is tracked."""
WINDOW_RADIUS_PX = 64
"""Pixels around a mark in which its highlight is tracked."""
MAX_TRACK_STEP_PX = 5.0
"""Distance of a highlight from its predicted position, from one frame to the next."""
MAX_AREA_CHANGE = 2.5
"""Ratio of areas from one frame to the next beyond which a highlight has split or merged."""
MAX_OVERLAP_SHARE = 0.1
"""Share of a highlight's pixels that another one may have in the neighbouring frame before both count as merged."""
CLICK_RADIUS_PX = 4.0
"""Distance between a mark and the highlight that it means."""
CONFLICT_RADIUS_PX, CONFLICT_RADIUS_DEG = 1, 3.0
"""Distance of pixels and angle of half vectors within which a true and a false mark contradict each other."""


@dataclass(frozen=True, slots=True)
class Tracks:
    """Marks with their tracks.

    conflicts: messages about true and false tracks that met, both excluded there. warnings: messages about marks
    without a highlight.
    """

    marks: Marks
    conflicts: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Blob:
    """Connected bright pixels of a window: their label there and their number."""

    label: int
    area: int


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Position of a highlight in a frame, in pixels of the region; mark: its index."""

    row: int
    column: int
    frame: int
    mark: int


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
    keyframes = sorted({mark.frame for mark in marks})
    points: list[TrackPoint] = []
    warnings = []
    for number, mark in enumerate(marks):
        if not 0 <= mark.frame < len(half_vectors):
            raise ValueError(f"mark {number} is at frame {mark.frame} of {len(half_vectors)}")
        before = max((frame for frame in keyframes if frame < mark.frame), default=-1)
        after = min((frame for frame in keyframes if frame > mark.frame), default=len(half_vectors))
        span = slice(max(before + 1, mark.frame - MAX_TRACK_FRAMES), min(after, mark.frame + MAX_TRACK_FRAMES + 1))
        mark_points = [
            TrackPoint(row, column, frame, number)
            for row, column, frame in _track_points(mark, span, read, thresholds, mask)
            if np.isfinite(half_vectors[frame, 0])
        ]
        if not mark_points:
            has_light = bool(np.isfinite(half_vectors[mark.frame, 0]))
            warnings.append(_warning(number, mark, origin, has_light))
        points += mark_points
    conflicts, excluded = _conflicts(points, marks, half_vectors, origin)
    kept = sorted({(p.row, p.column, p.frame, int(marks[p.mark].true)) for p in points if p not in excluded})
    if not kept:
        return Tracks(Marks.empty(), conflicts, tuple(warnings))
    table = np.array(kept, np.int32)
    tracked = Marks(table[:, :2], half_vectors[table[:, 2]].astype(np.float32), table[:, 3].astype(np.int8))
    return Tracks(tracked, conflicts, tuple(warnings))


def _warning(number: int, mark: Mark, origin: tuple[int, int], has_light: bool) -> str:
    reason = (
        f"has no highlight within {CLICK_RADIUS_PX:g} pixels" if has_light else "is at a frame whose light was rejected"
    )
    return f"mark {number} ({_describe(mark, origin)}) {reason}: move or remove it"


def _describe(mark: Mark, origin: tuple[int, int]) -> str:
    kind = "true" if mark.true else "false"
    return f"{kind}, frame {mark.frame}, x {mark.x + origin[0]:g}, y {mark.y + origin[1]:g}"


def _track_points(
    mark: Mark, span: slice, read: FrameReader, thresholds: np.ndarray, mask: np.ndarray
) -> Iterator[tuple[int, int, int]]:
    """Yield row, column and frame of a mark's highlight over `span` of frames, as far as it can be tracked."""
    top, left = max(int(mark.y) - WINDOW_RADIUS_PX, 0), max(int(mark.x) - WINDOW_RADIUS_PX, 0)
    window = slice(top, int(mark.y) + WINDOW_RADIUS_PX + 1), slice(left, int(mark.x) + WINDOW_RADIUS_PX + 1)
    lit = (read(span, *window) > thresholds[window]) & mask[window]
    start = mark.frame - span.start
    click = (mark.x - left, mark.y - top)
    labels, blobs = _blobs(lit[start])
    blob = _nearest(labels, blobs, click, CLICK_RADIUS_PX)
    if blob is None:
        return
    is_single = is_single_highlight(labels == blob.label)
    centre = blob_centre(labels == blob.label, click) if is_single else None
    if centre is None:
        # Several highlights in one: where its centre lies is unknown, but the user saw a highlight at this pixel.
        row, column = round(mark.y), round(mark.x)
        if lit[start][row - top, column - left]:
            yield row, column, mark.frame
        return
    yield round(centre[1]) + top, round(centre[0]) + left, mark.frame
    for direction in (1, -1):
        for index, position in _positions(lit, start, direction, blob, centre):
            yield round(position[1]) + top, round(position[0]) + left, span.start + index


def _positions(lit: np.ndarray, start: int, direction: int, blob: Blob, centre: Point) -> Iterator[tuple[int, Point]]:
    """Yield frame index and centre of a blob in the frames lit (T, h, w) bool after `start`, or before it.

    blob, centre: at `start`. direction: 1 forward, -1 backward in time.
    """
    labels, _ = _blobs(lit[start])
    position, predicted = centre, centre
    index = start + direction
    while 0 <= index < len(lit):
        next_labels, blobs = _blobs(lit[index])
        next_blob = _nearest(next_labels, blobs, predicted, MAX_TRACK_STEP_PX)
        if next_blob is None or not _is_same(labels, blob, next_labels, next_blob):
            return
        next_position = blob_centre(next_labels == next_blob.label, predicted)
        if next_position is None or not next_labels[round(next_position[1]), round(next_position[0])]:
            return
        # Constant velocity: the next step equals this one.
        predicted = 2 * next_position[0] - position[0], 2 * next_position[1] - position[1]
        labels, blob, position = next_labels, next_blob, next_position
        yield index, position
        index += direction


def _blobs(lit: np.ndarray) -> tuple[np.ndarray, list[Blob]]:
    """Return the labels (h, w) of the blobs of lit (h, w) bool, 0 being dark, and the blobs from label 1 on."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(lit.astype(np.uint8), connectivity=8)
    return labels, [Blob(label, int(stats[label, cv2.CC_STAT_AREA])) for label in range(1, count)]


def _nearest(labels: np.ndarray, blobs: list[Blob], position: Point, radius: float) -> Blob | None:
    """Return the blob with the pixel nearest to a position (x, y), if within `radius` pixels."""
    if not blobs:
        return None
    rows, columns = np.nonzero(labels)
    distance = np.hypot(columns - position[0], rows - position[1])
    nearest = int(distance.argmin())
    return blobs[labels[rows[nearest], columns[nearest]] - 1] if distance[nearest] <= radius else None


def _is_same(labels: np.ndarray, blob: Blob, next_labels: np.ndarray, next_blob: Blob) -> bool:
    """Return whether blobs of two consecutive frames are one highlight that has neither merged nor split.

    labels, next_labels: (h, w), of the two frames.
    """
    if not 1 / MAX_AREA_CHANGE <= next_blob.area / blob.area <= MAX_AREA_CHANGE:
        return False
    limit = MAX_OVERLAP_SHARE * min(blob.area, next_blob.area)
    for frame_labels, own, pixels in (
        (labels, blob.label, next_labels == next_blob.label),
        (next_labels, next_blob.label, labels == blob.label),
    ):
        # Pixels of the blob in the neighbouring frame that belong to further blobs there.
        overlaps = np.bincount(frame_labels[pixels])
        overlaps[: own + 1][[0, -1]] = 0
        if (overlaps > limit).any():
            return False
    return is_single_highlight(next_labels == next_blob.label)


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
        f"marks {true} ({_describe(marks[true], origin)}) and {not_true} ({_describe(marks[not_true], origin)}) meet"
        f" at x {met[0].column + origin[0]}, y {met[0].row + origin[1]} in frame {met[0].frame}:"
        " neither counts there; check them"
        for (true, not_true), met in pairs.items()
    ]
    return tuple(messages), excluded
