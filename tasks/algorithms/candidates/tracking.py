"""Tracking of a highlight from frame to frame ("automatic tracking technique", section 4.1 of Yeung et al. 2009).

Bright blobs of a frame are associated with those of the next by nearest neighbour about a predicted position (constant
velocity), and tracks end wherever blobs may have merged or split.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.candidates.blob_shape import blob_centre, is_single_highlight
from glint.tasks.algorithms.candidates.markup import Mark

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


@dataclass(frozen=True, slots=True)
class Blob:
    """Connected bright pixels of a window: their label there and their number."""

    label: int
    area: int


def follow_highlight(
    mark: Mark, span: slice, read: FrameReader, thresholds: np.ndarray, mask: np.ndarray
) -> Iterator[tuple[int, int, int]]:
    """Yield row, column and frame of a mark's highlight over `span` of frames, as far as it can be tracked.

    A mark beside the region, which may have been another when it was set, has no highlight.

    thresholds (H, W): luma above which a pixel is lit; mask (H, W) bool: the object.
    """
    row, column = round(mark.y), round(mark.x)
    if not (0 <= row < mask.shape[0] and 0 <= column < mask.shape[1]):
        return
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
    # A light that moves by less than its diameter lights some of the same pixels of a smooth surface again. A blob that
    # is apart from them is on another fold, or on another light path, that mirrors the light at the same time.
    grown = cv2.dilate((labels == blob.label).astype(np.uint8), np.ones((3, 3), np.uint8))
    if not grown[next_labels == next_blob.label].any():
        return False
    limit = MAX_OVERLAP_SHARE * min(blob.area, next_blob.area)
    for frame_labels, own, pixels in (
        (labels, blob.label, next_labels == next_blob.label),
        (next_labels, next_blob.label, labels == blob.label),
    ):
        # Pixels of the blob in the neighbouring frame that belong to further blobs there.
        overlaps = np.bincount(frame_labels[pixels], minlength=own + 1)
        overlaps[[0, own]] = 0
        if (overlaps > limit).any():
            return False
    return is_single_highlight(next_labels == next_blob.label)
