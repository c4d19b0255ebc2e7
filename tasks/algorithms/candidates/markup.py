"""Highlights that the user marked, tracked between keyframes, and what they pin (paper 4.1 and 4.2, METHOD 5)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit

Reader = Callable[[slice, slice, slice], np.ndarray]
"""Frames, rows and columns of the region -> (T, h, w)."""
FURTHEST = 64
"""Frames before and after its keyframe that a mark is followed at most, and pixels around it that are looked at."""
STEP = 5.0
"""Pixels that a highlight moves at most from where it was heading, from one frame to the next."""
GROWTH = 2.5
"""Ratio of areas from one frame to the next beyond which a highlight has split or met another one."""
MEETING = 0.1
"""Share of a highlight's pixels that another one must have had, or take over, in the neighbouring frame to count as
met or split off."""
LONG = 3.0
"""Ratio of length to width beyond which a highlight is a line along which the surface does not bend."""
SOLID = 0.8
"""Share of its convex hull that a single highlight fills; several run together leave gaps between them."""
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
    rules out those beyond twice that. Several true marks of a pixel give their mean.
    """
    marked, sums = np.zeros(mask.shape, dtype=bool), np.zeros((*mask.shape, 3), np.float32)
    pins = np.zeros(normals.shape[:3], dtype=np.int8)
    if marks is None:
        return marked, unit(sums), pins
    for (row, column), half_vector, kind in zip(marks.pixels, marks.half_vectors, marks.kind, strict=True):
        if not mask[row, column]:
            continue
        cosine = normals[:, row, column] @ half_vector
        near, far = cosine > np.cos(np.radians(reach)), cosine < np.cos(np.radians(2.0 * reach))
        if kind == 1:
            marked[row, column] = True
            sums[row, column] += half_vector
            pins[:, row, column] = np.where(near, 1, np.where(far, -1, pins[:, row, column]))
        else:
            pins[near, row, column] = -1
    return marked, unit(sums), pins


@dataclass(frozen=True, slots=True)
class Tracks:
    """Marks with their tracks; `conflicts` says where true and false ones met and were both left out, `warnings` which
    marks found no highlight."""

    marks: Marks
    conflicts: tuple[str, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Spot:
    """A connected bright spot of a window: its number there and its area in pixels."""

    number: int
    area: int


@dataclass(frozen=True, slots=True)
class Sighting:
    """The marked highlight `mark` at a frame, over a pixel of the region."""

    row: int
    column: int
    frame: int
    mark: int


def track(
    marks: Sequence[Mark],
    read: Reader,
    bars: np.ndarray,
    half_vectors: np.ndarray,
    mask: np.ndarray,
    origin: tuple[int, int] = (0, 0),
) -> Tracks:
    """Follow each marked highlight from its keyframe to the neighbouring keyframes.

    bars (H, W): luma above which a pixel is lit; half_vectors (T, 3), NaN where the frame was rejected; mask (H, W);
    origin: column and row of the region's first pixel in the full frame, whose pixels the messages speak of.
    The centre of a highlight is where the surface mirrors the lamp's centre, so its pixel gets the frame's half vector
    as its normal. A track ends where the highlight dims, leaves the object, jumps, splits or meets another one. One
    that is not single at its keyframe counts at the marked pixel alone.
    """
    keyframes = sorted({mark.frame for mark in marks})
    sightings: list[Sighting] = []
    warnings = []
    for number, mark in enumerate(marks):
        if not 0 <= mark.frame < len(half_vectors):
            raise ValueError(f"mark {number} is at frame {mark.frame} of {len(half_vectors)}")
        before = max((frame for frame in keyframes if frame < mark.frame), default=-1)
        after = min((frame for frame in keyframes if frame > mark.frame), default=len(half_vectors))
        span = slice(max(before + 1, mark.frame - FURTHEST), min(after, mark.frame + FURTHEST + 1))
        found = [
            Sighting(row, column, frame, number)
            for row, column, frame in _followed(mark, span, read, bars, mask)
            if np.isfinite(half_vectors[frame, 0])
        ]
        if not found:
            lit = np.isfinite(half_vectors[mark.frame, 0])
            warnings.append(
                f"mark {number} ({_told(mark, origin)}) "
                + (f"has no highlight within {CLICK:g} pixels" if lit else "is at a frame whose light was rejected")
                + ": move or remove it"
            )
        sightings += found
    conflicts, clashing = _clashes(sightings, marks, half_vectors, origin)
    kept = sorted({(s.row, s.column, s.frame, int(marks[s.mark].true)) for s in sightings if s not in clashing})
    if not kept:
        return Tracks(Marks.none(), conflicts, tuple(warnings))
    table = np.array(kept, np.int32)
    tracked = Marks(table[:, :2], half_vectors[table[:, 2]].astype(np.float32), table[:, 3].astype(np.int8))
    return Tracks(tracked, conflicts, tuple(warnings))


def _told(mark: Mark, origin: tuple[int, int]) -> str:
    kind = "true" if mark.true else "false"
    return f"{kind}, frame {mark.frame}, x {mark.x + origin[0]:g}, y {mark.y + origin[1]:g}"


def _followed(
    mark: Mark, span: slice, read: Reader, bars: np.ndarray, mask: np.ndarray
) -> Iterator[tuple[int, int, int]]:
    """Row, column and frame of a mark's highlight over `span` of frames, as far as it can be followed."""
    top, left = max(int(mark.y) - FURTHEST, 0), max(int(mark.x) - FURTHEST, 0)
    window = slice(top, int(mark.y) + FURTHEST + 1), slice(left, int(mark.x) + FURTHEST + 1)
    lit = (read(span, *window) > bars[window]) & mask[window]
    start = mark.frame - span.start
    names, spots = _spots(lit[start])
    spot = _nearest(names, spots, (mark.x - left, mark.y - top), CLICK)
    if spot is None:
        return
    origin = _middle(names, spot, (mark.x - left, mark.y - top)) if _single(names, spot) else None
    if origin is None:
        row, column = round(mark.y), round(mark.x)
        if lit[start][row - top, column - left]:
            yield row, column, mark.frame
        return
    yield round(origin[1]) + top, round(origin[0]) + left, mark.frame
    for direction in (1, -1):
        here, present, place, heading = names, spot, origin, origin
        index = start + direction
        while 0 <= index < len(lit):
            there, spots = _spots(lit[index])
            following = _nearest(there, spots, heading, STEP)
            if following is None or not _same(here, present, there, following):
                break
            arrived = _middle(there, following, heading)
            if arrived is None or not there[round(arrived[1]), round(arrived[0])]:
                break
            heading = 2 * arrived[0] - place[0], 2 * arrived[1] - place[1]
            here, present, place = there, following, arrived
            yield round(place[1]) + top, round(place[0]) + left, span.start + index
            index += direction


def _spots(lit: np.ndarray) -> tuple[np.ndarray, list[Spot]]:
    """Names (h, w) of the bright spots of lit (h, w) bool, 0 where there is none, and the spots from 1 on."""
    count, names, stats, _ = cv2.connectedComponentsWithStats(lit.astype(np.uint8), connectivity=8)
    return names, [Spot(number, int(stats[number, cv2.CC_STAT_AREA])) for number in range(1, count)]


def _nearest(names: np.ndarray, spots: list[Spot], place: tuple[float, float], reach: float) -> Spot | None:
    """The bright spot whose pixels come nearest to a place (x, y), if within `reach` pixels."""
    if not spots:
        return None
    rows, columns = np.nonzero(names)
    distance = np.hypot(columns - place[0], rows - place[1])
    nearest = int(distance.argmin())
    return spots[names[rows[nearest], columns[nearest]] - 1] if distance[nearest] <= reach else None


def _middle(names: np.ndarray, spot: Spot, place: tuple[float, float]) -> tuple[float, float] | None:
    """Centre x, y of a spot; of a long one the point of its middle line that is nearest to a place (x, y).

    None for a spot that the window cuts off, unless it is long.
    """
    pixels = np.argwhere(names == spot.number)[:, ::-1].astype(float)
    centre = pixels.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(pixels.T, bias=True) + np.eye(2) / 12.0)
    width, length = np.sqrt(3.0 * values)
    along = vectors[:, 1]
    slack = max(0.0, length - LONG * width)
    edges = pixels.min() == 0 or (pixels.max(axis=0) == np.array(names.shape)[::-1] - 1).any()
    if edges and slack == 0:
        return None
    x, y = centre + along * np.clip((np.array(place) - centre) @ along, -slack, slack)
    return float(x), float(y)


def _same(here: np.ndarray, spot: Spot, there: np.ndarray, following: Spot) -> bool:
    """Whether a spot and that which follows it in the next frame are one highlight that neither met another nor split.

    here, there: names (h, w) of the spots of the two frames.
    """
    if not 1 / GROWTH <= following.area / spot.area <= GROWTH:
        return False
    least = MEETING * min(spot.area, following.area)
    for names, own, pixels in (
        (here, spot.number, there == following.number),
        (there, following.number, here == spot.number),
    ):
        others = np.bincount(names[pixels])
        others[: own + 1][[0, -1]] = 0
        if (others > least).any():
            return False
    return _single(there, following)


def _single(names: np.ndarray, spot: Spot) -> bool:
    """Whether a spot fills its convex hull, as a single highlight does."""
    rows, columns = np.nonzero(names == spot.number)
    hull = cv2.convexHull(np.stack([columns, rows], axis=-1).astype(np.int32))
    pixels = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    return spot.area >= SOLID * pixels


def _clashes(
    sightings: list[Sighting],
    marks: Sequence[Mark],
    half_vectors: np.ndarray,
    origin: tuple[int, int],
    pixels: int = 1,
    degrees: float = 3.0,
) -> tuple[tuple[str, ...], set[Sighting]]:
    """Where true and false marks claim neighbouring pixels for nearly one half vector: texts, and what to leave out."""
    table = np.array([(s.row, s.column, s.frame, s.mark) for s in sightings]).reshape(-1, 4)
    kind = np.array([marks[s.mark].true for s in sightings], bool)
    false = np.flatnonzero(~kind)
    out: set[Sighting] = set()
    pairs: dict[tuple[int, int], list[Sighting]] = {}
    for index in np.flatnonzero(kind):
        near = false[(np.abs(table[false, :2] - table[index, :2]) <= pixels).all(axis=1)]
        alike = half_vectors[table[near, 2]] @ half_vectors[table[index, 2]] > np.cos(np.radians(degrees))
        for other in near[alike].tolist():
            out |= {sightings[index], sightings[other]}
            pairs.setdefault((sightings[index].mark, sightings[other].mark), []).append(sightings[index])
    texts = [
        f"marks {true} ({_told(marks[true], origin)}) and {not_true} ({_told(marks[not_true], origin)}) meet"
        f" at x {places[0].column + origin[0]}, y {places[0].row + origin[1]} in frame {places[0].frame}:"
        " neither counts there; check them"
        for (true, not_true), places in pairs.items()
    ]
    return tuple(texts), out
