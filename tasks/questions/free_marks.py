"""Marks that a person sets freely: which highlight is meant, and why a mark of it is refused."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.storage.errors import InputError
from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.candidates.marked_tracks import CONFLICT_RADIUS_DEG, CONFLICT_RADIUS_PX
from glint.tasks.algorithms.candidates.marked_tracks import TrackPoint as Point
from glint.tasks.algorithms.candidates.markup import MARK_RADIUS_DEG
from glint.tasks.algorithms.candidates.tracking import CLICK_RADIUS_PX
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.questions.capture_questions import CaptureQuestions
from glint.tasks.stages.clusters import disc_deg

SNAP_RADIUS_PX = 12.0
"""Distance between a click and the highlight that it means, pixels: a fingertip on a picture shown at its own size."""
STROKE_SPACING_PX = 12.0
"""Distance between the marks of a line that is drawn over a picture of all frames, pixels: tracks fill the gaps."""
MAX_STROKE_MARKS = 6
"""Marks that one line sets at most: more would tell nothing new of one sheet."""
SAME_SHEET_DEG = 15.0
"""Angle between the candidates of neighbouring points of a line within which they are of one sheet, degrees."""


@dataclass(frozen=True, slots=True)
class Highlight:
    """A highlight to be marked: a frame and a pixel of the region.

    layer: the pixel's candidate that the highlight belongs to, None where none is within MARK_RADIUS_DEG of its half
    vector; nearest_deg: angle to the nearest one, infinite without candidates. track: the path through the frames.
    """

    frame: int
    row: int
    column: int
    layer: int | None
    nearest_deg: float
    track: tuple[Point, ...] = ()

    def annotation(self, held: CaptureQuestions, kind: str) -> AnnotationEntry:
        """Return it as an annotation, `true` or `false`."""
        x, y = held.frame_position(self.row, self.column)
        return AnnotationEntry.model_validate({"frame": self.frame, "x": float(x), "y": float(y), "kind": kind})


def highlight_in_frame(held: CaptureQuestions, frame: int, row: int, column: int) -> Highlight:
    """Return the highlight of a frame that is nearest to a pixel of the region.

    Raises:
        InputError: the frame has no known light, or no highlight of the object is near; it names the nearest one.
    """
    on_object = _lit(held, frame)
    distance = _distances(on_object, row, column)
    nearest = np.unravel_index(int(distance.argmin()), distance.shape)
    if distance[nearest] > SNAP_RADIUS_PX:
        raise _nothing_near(held, frame, row, column, distance)
    return _tracked(held, frame, int(nearest[0]), int(nearest[1]))


def highlights_at(held: CaptureQuestions, row: int, column: int) -> list[Highlight]:
    """Return the highlights of all frames near a pixel of the region: one for each candidate there, the heaviest first.

    Raises:
        InputError: no frame shows a highlight there; it names the nearest pixel with candidates.
    """
    known = held.candidate_pixels
    distance = _distances(known, row, column)
    order = np.argsort(distance, axis=None, kind="stable")
    for place in order[: int((distance <= SNAP_RADIUS_PX).sum())]:
        near_row, near_column = (int(index) for index in np.unravel_index(place, distance.shape))
        shown = [_shown(held, layer, near_row, near_column) for layer in _layers(held, near_row, near_column)]
        if any(shown):
            return [highlight for highlight in shown if highlight is not None]
    raise _nothing_near(held, None, row, column, distance)


def highlights_along(held: CaptureQuestions, frame: int | None, points: Sequence[tuple[int, int]]) -> list[Highlight]:
    """Return the highlights under a line of pixels (row, column): of a frame, or (None) of one sheet in all frames.

    Raises:
        InputError: there is none, as for the line's first point alone.
    """
    if frame is not None:
        return _of_frame_along(held, frame, points) or [highlight_in_frame(held, frame, *points[0])]
    return _of_sheet_along(held, points) or highlights_at(held, *points[0])[:1]


def _of_frame_along(held: CaptureQuestions, frame: int, points: Sequence[tuple[int, int]]) -> list[Highlight]:
    """Return the highlights of a frame that a line passes, each once, at most MAX_STROKE_MARKS."""
    on_object, highlights = _lit(held, frame), dict[tuple[int, int], Highlight]()
    for row, column in points:
        distance = _distances(on_object, row, column)
        nearest = np.unravel_index(int(distance.argmin()), distance.shape)
        if distance[nearest] <= CLICK_RADIUS_PX and len(highlights) < MAX_STROKE_MARKS:
            highlight = _tracked(held, frame, int(nearest[0]), int(nearest[1]))
            highlights.setdefault((highlight.row, highlight.column), highlight)
    return list(highlights.values())


def _of_sheet_along(held: CaptureQuestions, points: Sequence[tuple[int, int]]) -> list[Highlight]:
    """Return the highlights that show, every STROKE_SPACING_PX along a line, the sheet that it follows."""
    line, normal = list[Highlight](), None
    for row, column in points:
        layers = _layers(held, row, column) if held.candidate_pixels[row, column] else []
        if layers and normal is not None:
            # The candidate of the sheet that the line has followed so far.
            turns = angles(held.clusters.normals[layers, row, column], normal)
            layers = [layers[int(turns.argmin())]] if turns.min() < SAME_SHEET_DEG else []
        if not layers or len(line) == MAX_STROKE_MARKS:
            continue
        if line and np.hypot(row - line[-1].row, column - line[-1].column) < STROKE_SPACING_PX:
            normal = held.clusters.normals[layers[0], row, column]
            continue
        shown = next((item for item in (_shown(held, layer, row, column) for layer in layers) if item), None)
        if shown is not None:
            line.append(shown)
            normal = held.clusters.normals[shown.layer, row, column]
    return line


def refusal(held: CaptureQuestions, highlight: Highlight, kind: str, marks: tuple[AnnotationEntry, ...]) -> str | None:
    """Return why a highlight cannot be marked as `true` or `false` beside the marks that there are; None: it can."""
    x, y = held.frame_position(highlight.row, highlight.column)
    place = f"the highlight at x {x}, y {y} in frame {highlight.frame:,}"
    if kind == "false" and highlight.layer is None:
        nearest = f"the nearest is {highlight.nearest_deg:.0f}° away" if np.isfinite(highlight.nearest_deg) else "none"
        return (
            f"{place} gave no candidate ({nearest}; it must be within {MARK_RADIUS_DEG:g}°), so that there is nothing"
            " to call false: leave it"
        )
    half_vector = held.frames.half_vectors_of(highlight.row, highlight.column)[highlight.frame]
    if kind == "true" and half_vector[2] <= 0:
        return f"{place} would need a surface that faces away from the camera: call it false"
    own = highlight.track or (Point(highlight.row, highlight.column, highlight.frame, 0),)
    return _contradiction(held, own, kind, marks, place)


def _contradiction(
    held: CaptureQuestions, own: Sequence[Point], kind: str, marks: tuple[AnnotationEntry, ...], place: str
) -> str | None:
    """Return what speaks against a track (of the highlight named `place`) among the tracks of the marks."""
    tracks = held.frames.tracks(marks)
    mine = np.array([(point.row, point.column, point.frame) for point in own])
    for number, mark in enumerate(marks):
        path = np.array([(point.row, point.column, point.frame) for point in tracks.path(number)], int).reshape(-1, 3)
        beside = (np.abs(path[:, None, :2] - mine[None, :, :2]) <= CONFLICT_RADIUS_PX).all(axis=-1)
        turn = angles(held.frames.half_vectors[path[:, None, 2]], held.frames.half_vectors[mine[None, :, 2]])
        name = f"mark {number + 1} ({mark.kind}, frame {mark.frame:,}, x {mark.x:g}, y {mark.y:g})"
        if (beside & (turn <= CONFLICT_RADIUS_DEG)).any():
            if mark.kind == kind:
                return f"{place} is marked as {kind} already, by {name}: nothing is to be done"
            return f"{place} is the one that {name} calls {mark.kind}: remove that mark first"
        is_second_normal = beside & (turn > 2 * MARK_RADIUS_DEG)
        if kind == mark.kind == "true" and is_second_normal.any():
            row, column, _ = path[np.argwhere(is_second_normal)[0][0]]
            x, y = held.frame_position(int(row), int(column))
            degrees = turn[is_second_normal].max()
            return (
                f"{place} and {name} would give the surface two normals at x {x}, y {y}, {degrees:.0f}° apart: only"
                " one of them is true; call this one false, or remove that mark"
            )
    return None


def _lit(held: CaptureQuestions, frame: int) -> np.ndarray:
    """Return the pixels (H, W) bool of the object that are lit in a frame.

    Raises:
        InputError: there is no such frame, or its light is not known.
    """
    if not frame < len(held.frames.half_vectors):
        raise InputError(f"there is no frame {frame:,}", f"the last one is {len(held.frames.half_vectors) - 1:,}")
    usable = np.flatnonzero(np.isfinite(held.frames.half_vectors[:, 0]))
    if frame not in usable:
        remedy = "see the warnings of the lights"
        if len(usable):
            remedy = f"go to frame {usable[np.argmin(np.abs(usable - frame))]:,}, the nearest one with a light"
        raise InputError(f"the light of frame {frame:,} is not known, so that its highlights say nothing", remedy)
    return np.asarray((held.frames.levels_of_frame(frame) > held.frames.thresholds) & held.mask)


def _distances(pixels: np.ndarray, row: int, column: int) -> np.ndarray:
    """Return the distances (H, W) of the set pixels (H, W) bool from one, infinite elsewhere."""
    rows, columns = np.ogrid[: pixels.shape[0], : pixels.shape[1]]
    return np.where(pixels, np.hypot(rows - row, columns - column), np.inf)


def _nothing_near(held: CaptureQuestions, frame: int | None, row: int, column: int, distance: np.ndarray) -> InputError:
    """Return the refusal of a pixel without a highlight near; distance (H, W): of the highlights there are."""
    x, y = held.frame_position(row, column)
    where = "any frame" if frame is None else f"frame {frame:,}"
    text = f"no highlight of the object lies within {SNAP_RADIUS_PX:g} pixels of x {x}, y {y} in {where}"
    if not held.mask[row, column]:
        text += "; this is outside the mask"
    lit = held.frames.lit_at(row, column)
    elsewhere = f"go to frame {lit[0]:,}, in which this pixel is lit" if len(lit) and frame is not None else ""
    if not np.isfinite(distance).any():
        return InputError(text, elsewhere or "go to another frame, or see whether the mask is right")
    nearest = np.unravel_index(int(distance.argmin()), distance.shape)
    near_x, near_y = held.frame_position(int(nearest[0]), int(nearest[1]))
    text += f"; the nearest is {distance[nearest]:.0f} pixels away, at x {near_x}, y {near_y}"
    return InputError(text, f"click there, or {elsewhere}" if elsewhere else "click there")


def _tracked(held: CaptureQuestions, frame: int, row: int, column: int) -> Highlight:
    """Return the highlight at a lit pixel, at its centre where it is single, with its track."""
    highlight = _with_candidate(held, frame, row, column)
    track = _track(held, highlight)
    centre = next((point for point in track if point.frame == frame), None)
    if centre is not None and (centre.row, centre.column) != (row, column):
        highlight = _with_candidate(held, frame, centre.row, centre.column)
        track = _track(held, highlight) or track
    return replace(highlight, track=track)


def _shown(held: CaptureQuestions, layer: int, row: int, column: int) -> Highlight | None:
    """Return the highlight that shows a candidate best; None if no frame does."""
    angle = angles(held.frames.half_vectors_of(row, column), held.clusters.normals[layer, row, column])
    radius = disc_deg(held.work)
    shown = [frame for frame in held.frames.lit_at(row, column).tolist() if angle[frame] < radius]
    if not shown:
        return None
    frame = min(shown, key=lambda item: float(angle[item]))
    highlight = Highlight(frame, row, column, layer, float(angle[frame]))
    return replace(highlight, track=_track(held, highlight))


def _track(held: CaptureQuestions, highlight: Highlight) -> tuple[Point, ...]:
    return tuple(held.frames.tracks((highlight.annotation(held, "true"),)).path(0))


def _layers(held: CaptureQuestions, row: int, column: int) -> list[int]:
    """Return the candidates of a pixel, the heaviest first."""
    weight = np.where(np.isfinite(held.clusters.normals[:, row, column, 0]), held.clusters.weight[:, row, column], -1.0)
    order = np.argsort(-weight, kind="stable")
    return [int(layer) for layer in order if weight[layer] >= 0]


def _with_candidate(held: CaptureQuestions, frame: int, row: int, column: int) -> Highlight:
    half_vector = held.frames.half_vectors_of(row, column)[frame]
    turns = np.nan_to_num(angles(held.clusters.normals[:, row, column], half_vector), nan=np.inf)
    layer = int(turns.argmin())
    nearest = float(turns[layer])
    return Highlight(frame, row, column, layer if nearest <= MARK_RADIUS_DEG else None, nearest)
