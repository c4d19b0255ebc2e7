"""Highlights that the user marked, tracked between keyframes, and what they pin (paper 4.1 and 4.2, METHOD 5)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

Reader = Callable[[slice, slice, slice], np.ndarray]
"""Frames, rows and columns of the region -> (T, h, w)."""
FURTHEST = 64
"""Frames before and after its keyframe that a mark is followed at most, and pixels around it that are looked at."""
STEP = 5.0
"""Pixels that a highlight moves at most from where it was heading, from one frame to the next."""
GROWTH = 2.5
"""Ratio of areas from one frame to the next beyond which a highlight has split or met another one."""
CLICK = 4.0
"""Pixels between a mark and the bright spot that it means."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A highlight marked at a frame, x and y in pixels of the region; `true`: on the exterior surface."""

    frame: int
    x: float
    y: float
    true: bool


@dataclass(frozen=True, slots=True)
class Marks:
    """Highlights marked or tracked: pixels (N, 2) int32 (row, column), half_vectors (N, 3) float32, kind (N,) int8:
    1 true, 0 false."""

    pixels: np.ndarray
    half_vectors: np.ndarray
    kind: np.ndarray

    @classmethod
    def none(cls) -> "Marks":
        """No marks."""
        return cls(np.zeros((0, 2), np.int32), np.zeros((0, 3), np.float32), np.zeros(0, np.int8))


def pinned(
    marks: Marks | None, normals: np.ndarray, mask: np.ndarray, reach: float = 6.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Marked pixels (H, W), their normals (H, W, 3), and the nodes pinned (K, H, W): +1 exterior, -1 false, 0 free.

    normals (K, H, W, 3) of the clusters. A mark pins the clusters of its pixel within `reach` degrees; a true one also
    rules out the pixel's others.
    """
    marked, values = np.zeros(mask.shape, dtype=bool), np.full((*mask.shape, 3), np.nan, np.float32)
    pins = np.zeros(normals.shape[:3], dtype=np.int8)
    if marks is None:
        return marked, values, pins
    for (row, column), half_vector, kind in zip(marks.pixels, marks.half_vectors, marks.kind, strict=True):
        if not mask[row, column]:
            continue
        near = normals[:, row, column] @ half_vector > np.cos(np.radians(reach))
        if kind == 1:
            marked[row, column], values[row, column] = True, half_vector
            pins[:, row, column] = np.where(near, 1, -1)
        else:
            pins[near, row, column] = -1
    return marked, values, pins


@dataclass(frozen=True, slots=True)
class Tracks:
    """Marks with their tracks; `conflicts` says where true and false ones met and were both left out, `warnings` which
    marks found no highlight."""

    marks: Marks
    conflicts: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Spot:
    """A connected bright spot: centroid x, y in pixels of the region, and area in pixels."""

    x: float
    y: float
    area: int


def track(marks: Sequence[Mark], read: Reader, bars: np.ndarray, half_vectors: np.ndarray, mask: np.ndarray) -> Tracks:
    """Follow each marked highlight from its keyframe to the neighbouring keyframes.

    bars (H, W): luma above which a pixel is lit; half_vectors (T, 3), NaN where the frame was rejected; mask (H, W).
    The centre of a highlight is where the surface mirrors the lamp's centre, so its pixel gets the frame's half vector
    as its normal. A track ends where the highlight dims, leaves the object, jumps, splits or meets another one.
    """
    keyframes = sorted({mark.frame for mark in marks})
    rows: list[tuple[int, int, int, int]] = []
    warnings = []
    for number, mark in enumerate(marks):
        before = max((frame for frame in keyframes if frame < mark.frame), default=-1)
        after = min((frame for frame in keyframes if frame > mark.frame), default=len(half_vectors))
        span = slice(max(before + 1, mark.frame - FURTHEST), min(after, mark.frame + FURTHEST + 1))
        found = [
            (row, column, frame)
            for row, column, frame in _followed(mark, span, read, bars, mask)
            if np.isfinite(half_vectors[frame, 0])
        ]
        if not found:
            warnings.append(
                f"mark {number} at frame {mark.frame}, x {mark.x:.1f}, y {mark.y:.1f} of the region has no highlight"
                f" within {CLICK:g} pixels, or its frame no light: move or remove it"
            )
        rows += [(row, column, frame, int(mark.true)) for row, column, frame in found]
    if not rows:
        return Tracks(Marks.none(), (), tuple(warnings))
    table = np.array(sorted(set(rows)), np.int64)
    clash = _clashes(table, half_vectors)
    kept = table[~clash]
    conflicts = tuple(
        f"pixel x {column}, y {row} of the region is marked both true and false near frame {frame}: neither counts"
        for row, column, frame, kind in table[clash].tolist()
        if kind == 1
    )
    tracked = Marks(
        kept[:, :2].astype(np.int32), half_vectors[kept[:, 2]].astype(np.float32), kept[:, 3].astype(np.int8)
    )
    return Tracks(tracked, conflicts, tuple(warnings))


def _followed(
    mark: Mark, span: slice, read: Reader, bars: np.ndarray, mask: np.ndarray
) -> Iterator[tuple[int, int, int]]:
    """Row, column and frame of a mark's highlight over `span` of frames, as far as it can be followed."""
    top, left = max(int(mark.y) - FURTHEST, 0), max(int(mark.x) - FURTHEST, 0)
    window = slice(top, int(mark.y) + FURTHEST + 1), slice(left, int(mark.x) + FURTHEST + 1)
    lit = (read(span, *window) > bars[window]) & mask[window]
    start = mark.frame - span.start
    origin = _nearest(lit[start], mark.x - left, mark.y - top, CLICK)
    if origin is None:
        return
    yield round(origin.y) + top, round(origin.x) + left, mark.frame
    for direction in (1, -1):
        spot, speed = origin, (0.0, 0.0)
        index = start + direction
        while 0 <= index < len(lit):
            following = _nearest(lit[index], spot.x + speed[0], spot.y + speed[1], STEP)
            if following is None or not 1 / GROWTH <= following.area / spot.area <= GROWTH:
                break
            speed, spot = (following.x - spot.x, following.y - spot.y), following
            row, column = round(spot.y) + top, round(spot.x) + left
            if not mask[row, column]:
                break
            yield row, column, span.start + index
            index += direction


def _nearest(lit: np.ndarray, x: float, y: float, reach: float) -> Spot | None:
    """The bright spot (of lit, (h, w) bool) whose pixels come nearest to a place, if within `reach` pixels."""
    count, names, stats, centres = cv2.connectedComponentsWithStats(lit.astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(lit)
    if count == 1:
        return None
    distance = np.hypot(columns - x, rows - y)
    nearest = int(distance.argmin())
    if distance[nearest] > reach:
        return None
    name = names[rows[nearest], columns[nearest]]
    return Spot(float(centres[name, 0]), float(centres[name, 1]), int(stats[name, cv2.CC_STAT_AREA]))


def _clashes(table: np.ndarray, half_vectors: np.ndarray, pixels: int = 1, degrees: float = 3.0) -> np.ndarray:
    """Which rows (row, column, frame, kind) lie beside one of the other kind with nearly the same half vector."""
    clash = np.zeros(len(table), bool)
    true, false = np.flatnonzero(table[:, 3] == 1), np.flatnonzero(table[:, 3] == 0)
    for index in true:
        near = false[(np.abs(table[false, :2] - table[index, :2]) <= pixels).all(axis=1)]
        alike = half_vectors[table[near, 2]] @ half_vectors[table[index, 2]] > np.cos(np.radians(degrees))
        clash[near[alike]] = True
        clash[index] = alike.any()
    return clash
