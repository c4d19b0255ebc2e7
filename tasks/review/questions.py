"""What the questions view shows of a capture: sheets to ask about, loops of their frames, and the labels as answered.

What a labelling reads is kept in memory for the captures asked about last, so that an answer is labelled at once.
"""

from dataclasses import dataclass, field
from threading import Lock
from time import monotonic
from typing import Any

import numpy as np

from glint.storage.errors import InputError
from glint.storage.export.image_files import colour_normals, encode_png
from glint.storage.footage.luma import eight_bits
from glint.storage.inputs.markup import AnnotationEntry, read_marks
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.questions.capture_questions import CaptureQuestions, ShownQuestion
from glint.tasks.review.stored import current_edits, saved_records
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.markup import load_marks

COUNT = 10
"""Questions that are proposed at a time."""
LOOP_FRAMES = 24
"""Frames that a loop shows before and after the question's own: two seconds at 24 frames per second."""
WINDOW_PX = 56
"""Pixels around a highlight that a loop shows, on each side."""
KEPT = 2
"""Captures whose candidates a server keeps in memory."""
CHANGED_DEG = 2.0
"""Angle from which a normal counts as changed, degrees: below, only noise is averaged differently."""
NEEDED = ("survey", "frames", "lights", "mask", "silhouette", "thresholds", "clusters", "labels")
"""Stages that must have run before questions are asked."""

Marks = tuple[AnnotationEntry, ...]


@dataclass(frozen=True, slots=True)
class Labelling:
    """The labels with a set of marks: normals (H, W, 3), how long it took, and what it changed."""

    normals: np.ndarray
    seconds: float
    changed_pixels: int
    changed_deg: float


@dataclass
class Session:
    """A capture that is asked about. The lock is held while one request computes.

    before: normals (H, W, 3) of the draft with the marks of the last run.
    """

    questions: CaptureQuestions
    before: np.ndarray | None = None
    lock: Lock = field(default_factory=Lock)
    proposals: dict[Marks, list[ShownQuestion]] = field(default_factory=dict)
    labellings: dict[Marks, Labelling] = field(default_factory=dict)


def questions(context: CaptureContext) -> dict[str, Any]:
    """Return the next questions about a capture as JSON values, and the marks that it has.

    Pixels are those of the full frame; `sheet`: pixels (x, y) of the sheet; `loop`: its frames and its window;
    `lights`: x and y of the frames' half vectors, None where the light was rejected.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    session, (revision, marks) = session_of(context), saved_marks(context)
    with session.lock:
        shown = _proposed(session, marks)
        _draft_before(session)  # so that the first answer need not wait for it
        return {
            "revision": revision,
            "marks": [mark.model_dump() for mark in marks],
            "questions": [facts_of(context, session.questions, item) for item in shown],
        }


def loop_strip(context: CaptureContext, frame: int, x: int, y: int, part: str) -> bytes:
    """Return the frames of a loop around a highlight, one below the other, as PNG.

    part: `object`, the window around the highlight; `sphere`, the first chrome sphere.

    Raises:
        InputError: it has not run yet, or there is no such frame or sphere; StoreError: the store cannot be read.
    """
    held = session_of(context).questions
    cache = open_frames(context)
    if frame >= cache.frames:
        raise InputError(f"there is no frame {frame:,}", f"the last one is {cache.frames - 1:,}")
    first, count = _loop(frame, cache.frames)
    if part == OBJECT:
        left, top, width, height = _window(held, x, y)
        region = held.geometry.region
        place = slice(top - region.y, top - region.y + height), slice(left - region.x, left - region.x + width)
        frames = cache.read(OBJECT, slice(first, first + count), *place)
    else:
        sphere = _sphere_crop(held)
        if sphere is None:
            raise InputError(f"{context.name} has no chrome sphere", "its lights are known from a file")
        frames = cache.read(sphere, slice(first, first + count))
    return encode_png(eight_bits(np.ascontiguousarray(frames)).reshape(-1, frames.shape[2]))


def labelling(context: CaptureContext) -> dict[str, Any]:
    """Return what the saved marks change of the capture's labels, as JSON values: a draft, made at once.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    revision, marks = saved_marks(context)
    made = _labelled(context, marks)
    return {
        "revision": revision,
        "seconds": round(made.seconds, 2),
        "changed_pixels": made.changed_pixels,
        "changed_deg": round(made.changed_deg, 1),
    }


def normals_picture(context: CaptureContext) -> bytes:
    """Return the normals of that draft as PNG of the region, x = red, y = green, z = blue.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    return encode_png(colour_normals(_labelled(context, saved_marks(context)[1]).normals, background=20))


def saved_marks(context: CaptureContext) -> tuple[int, Marks]:
    """Return the revision of a capture's edits and its marks: those that people saved, else those of its catalogue.

    Raises:
        StoreError: the store cannot be read.
    """
    edits, address = current_edits(context), context.file("markup")
    revision = 0 if edits is None else edits.revision
    if edits is not None and edits.marks is not None:
        return revision, edits.marks
    return revision, () if address is None else tuple(read_marks(address))


def _labelled(context: CaptureContext, marks: Marks) -> Labelling:
    session = session_of(context)
    with session.lock:
        if marks not in session.labellings:
            start = monotonic()
            before = _draft_before(session)
            normals = session.questions.draft_normals(session.questions.marks(list(marks)))
            change = np.nan_to_num(angles(normals, before))
            changed = change > CHANGED_DEG
            mean = float(change[changed].mean()) if changed.any() else 0.0
            made = Labelling(normals, monotonic() - start, int(changed.sum()), mean)
            session.labellings = {marks: made}
        return session.labellings[marks]


def _draft_before(session: Session) -> np.ndarray:
    if session.before is None:
        session.before = session.questions.draft_normals(load_marks(session.questions.work))
    return session.before


def _proposed(session: Session, marks: Marks) -> list[ShownQuestion]:
    if marks not in session.proposals:
        held, known = session.questions, session.questions.marks(list(marks))
        session.proposals = {marks: held.propose(held.stored_labels(known) or held.label(known), known, COUNT)}
    return session.proposals[marks]


def facts_of(context: CaptureContext, held: CaptureQuestions, shown: ShownQuestion) -> dict[str, Any]:
    """Return a question as JSON values, as `questions` describes them."""
    question, region = shown.question, held.geometry.region
    first, count = _loop(shown.frame, open_frames(context).frames)
    left, top, width, height = _window(held, shown.x, shown.y)
    sphere = _sphere_crop(held)
    crop = None if sphere is None else held.geometry.crops[sphere]
    lights = np.asarray(context.load("lights").read("half_vectors")[first : first + count, :2])
    return {
        "frame": shown.frame,
        "x": shown.x,
        "y": shown.y,
        "accepted": question.exterior,
        "wrong": round(question.wrong, 3),
        "sheet": [
            [int(column) + region.x, int(row) + region.y]
            for row, column in zip(question.rows, question.columns, strict=True)
        ],
        "loop": {"first": first, "count": count, "x": left, "y": top, "width": width, "height": height},
        "sphere": None if crop is None else {"width": crop.width, "height": crop.height},
        "lights": [[round(float(x), 3), round(float(y), 3)] if np.isfinite(x) else None for x, y in lights],
    }


def _loop(frame: int, frames: int) -> tuple[int, int]:
    """Return the first frame of a loop around `frame`, and their number."""
    first = max(0, frame - LOOP_FRAMES)
    return first, min(frames, frame + LOOP_FRAMES + 1) - first


def _window(held: CaptureQuestions, x: int, y: int) -> tuple[int, int, int, int]:
    """Return left, top, width and height of the window around a pixel, within the region.

    Raises:
        InputError: the pixel lies outside the region.
    """
    region = held.geometry.region
    if not (region.x <= x < region.x + region.width and region.y <= y < region.y + region.height):
        raise InputError(f"the pixel {x}, {y} lies outside the region", "choose one inside it")
    left, top = max(region.x, x - WINDOW_PX), max(region.y, y - WINDOW_PX)
    right = min(region.x + region.width, x + WINDOW_PX + 1)
    return left, top, right - left, min(region.y + region.height, y + WINDOW_PX + 1) - top


def _sphere_crop(held: CaptureQuestions) -> str | None:
    return next((name for name in held.geometry.crops if name != OBJECT), None)


def session_of(context: CaptureContext) -> Session:
    """Return what is kept of a capture, read anew where a run has changed it since.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    saved = saved_records(context)
    missing = [stage for stage in NEEDED if stage not in saved]
    if missing:
        raise InputError(f"{context.name} has no results of {', '.join(missing)} yet", "run the capture")
    key = (context.store, context.name, *(saved[stage][0] for stage in NEEDED))
    with _sessions_lock:
        session = _sessions.pop(key, None)
        if session is None:
            session = Session(CaptureQuestions(context))
        _sessions[key] = session
        while len(_sessions) > KEPT:
            del _sessions[next(iter(_sessions))]
        return session


_sessions: dict[tuple[str, ...], Session] = {}
"""Captures asked about, the last one at the end."""
_sessions_lock = Lock()
