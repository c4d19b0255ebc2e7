"""Collect what the questions view shows: sheets to ask about, loops of their frames, the labels as answered.

The inputs of a labelling are kept in memory for the most recent captures, so that an answer takes effect at once.
"""

from dataclasses import dataclass, field
from threading import Lock
from time import monotonic
from typing import Any

import numpy as np

from glint.storage.edits.edits import Edits
from glint.storage.edits.mark_authors import MarkAuthors
from glint.storage.errors import InputError
from glint.storage.export.image_files import colour_normals, encode_png
from glint.storage.inputs.markup import AnnotationEntry, read_marks
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.questions.capture_questions import CaptureQuestions, ShownQuestion
from glint.tasks.questions.kept_proposals import propose_or_recall
from glint.tasks.questions.loops import facts_of, loop_picture
from glint.tasks.review.stored import current_edits, saved_records
from glint.tasks.stages.markup import load_marks

COUNT = 10
"""Questions that are proposed at a time."""
KEPT = 2
"""Captures whose candidates a server keeps in memory."""
CHANGED_DEG = 2.0
"""Angle from which a normal counts as changed, degrees: below, only noise is averaged differently."""
NEEDED = ("survey", "frames", "lights", "mask", "silhouette", "thresholds", "clusters", "labels")
"""Stages that must have run before questions are asked."""

Annotations = tuple[AnnotationEntry, ...]


@dataclass(frozen=True, slots=True)
class Labelling:
    """The labels with a set of marks: normals (H, W, 3), how long it took, and what it changed."""

    normals: np.ndarray
    seconds: float
    changed_pixels: int
    changed_deg: float


@dataclass
class Session:
    """A capture with its questions. A lock is held while one request computes, so that no other does the same.

    keys: of the stages that it has, by stage. authors: of its marks. before: normals (H, W, 3) of the draft with the
    marks of the last run.
    """

    questions: CaptureQuestions
    keys: dict[str, str]
    authors: MarkAuthors
    before: np.ndarray | None = None
    proposal_lock: Lock = field(default_factory=Lock)
    labelling_lock: Lock = field(default_factory=Lock)
    marking_lock: Lock = field(default_factory=Lock)
    proposals: dict[Annotations, list[ShownQuestion]] = field(default_factory=dict)
    labellings: dict[Annotations, Labelling] = field(default_factory=dict)


def questions(context: CaptureContext) -> dict[str, Any]:
    """Return the next questions about a capture as JSON values (see `facts_of`), and the marks that it has.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    session, (revision, marks) = session_of(context), saved_marks(context)
    return {
        "revision": revision,
        "marks": [mark.model_dump() for mark in marks],
        "questions": [facts_of(session.questions, item) for item in _proposed(session, marks)],
    }


def loop_strip(context: CaptureContext, frame: int, x: int, y: int, part: str) -> bytes:
    """Return the frames of a loop around a highlight, or of the first chrome sphere in them (part `sphere`), as PNG.

    Raises:
        InputError: it has not run yet, or there is no such frame or sphere; StoreError: the store cannot be read.
    """
    return loop_picture(session_of(context).questions, frame, x, y, part)


def prepare(context: CaptureContext) -> None:
    """Make what the questions view will ask for: the questions, and the draft that the first answer is compared with.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    session, (revision, marks) = session_of(context), saved_marks(context)
    _proposed(session, marks)
    _draft_before(session)
    mark_authors(context, revision)


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


def saved_marks(context: CaptureContext) -> tuple[int, Annotations]:
    """Return the revision of a capture's edits and its marks: those that people saved, else those of its catalogue.

    Raises:
        StoreError: the store cannot be read.
    """
    edits = current_edits(context)
    revision = 0 if edits is None else edits.revision
    if edits is not None and edits.marks is not None:
        return revision, edits.marks
    return revision, _given_marks(context)


def mark_authors(context: CaptureContext, revision: int) -> dict[AnnotationEntry, str]:
    """Return who set each mark of a capture until a revision; those of its catalogue have no author.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    session = session_of(context)
    with session.marking_lock:
        return session.authors.at(Edits.open(context.location, context.object_id, create=False), revision)


def _given_marks(context: CaptureContext) -> Annotations:
    address = context.file("markup")
    return () if address is None else tuple(read_marks(address))


def _labelled(context: CaptureContext, marks: Annotations) -> Labelling:
    session = session_of(context)
    before = _draft_before(session)
    with session.labelling_lock:
        if marks not in session.labellings:
            start = monotonic()
            normals = session.questions.draft_normals(session.questions.frames.marks(list(marks)))
            change = np.nan_to_num(angles(normals, before))
            changed = change > CHANGED_DEG
            mean = float(change[changed].mean()) if changed.any() else 0.0
            made = Labelling(normals, monotonic() - start, int(changed.sum()), mean)
            session.labellings = {marks: made}
        return session.labellings[marks]


def _draft_before(session: Session) -> np.ndarray:
    with session.labelling_lock:
        if session.before is None:
            session.before = session.questions.draft_normals(load_marks(session.questions.work))
        return session.before


def _proposed(session: Session, marks: Annotations) -> list[ShownQuestion]:
    with session.proposal_lock:
        if marks not in session.proposals:
            session.proposals = {marks: propose_or_recall(session.questions, session.keys, marks, COUNT)}
        return session.proposals[marks]


def session_of(context: CaptureContext) -> Session:
    """Return the cached state of a capture, read again if a run has changed it.

    Raises:
        InputError: it has not run yet; StoreError: the store cannot be read.
    """
    saved = saved_records(context)
    missing = [stage for stage in NEEDED if stage not in saved]
    if missing:
        of_stages = f" of {', '.join(missing)}" if saved else ""
        raise InputError(f"{context.name} has no results{of_stages} yet", "run the capture")
    keys = {stage: saved[stage][0] for stage in NEEDED}
    key = (context.store, context.name, *keys.values())
    with _sessions_lock:
        session = _sessions.pop(key, None)
        if session is None:
            session = Session(CaptureQuestions(context), keys, MarkAuthors(context.capture.id, _given_marks(context)))
        _sessions[key] = session
        while len(_sessions) > KEPT:
            del _sessions[next(iter(_sessions))]
        return session


_sessions: dict[tuple[str, ...], Session] = {}
"""Captures with questions, the most recent last."""
_sessions_lock = Lock()
