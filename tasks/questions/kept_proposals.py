"""Questions that were proposed before, kept in the store by all that they follow from."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.inputs.markup import AnnotationEntry
from glint.storage.kept_values import keep, read_kept
from glint.storage.seals import digest_of
from glint.tasks.algorithms.questions.proposals import Question
from glint.tasks.questions.capture_questions import CaptureQuestions, ShownQuestion
from glint.tasks.stages.labels import has_readmission

PROPOSALS_VERSION = 3
"""Grows when other questions would be proposed about the same results."""


def propose_or_recall(
    held: CaptureQuestions, keys: Mapping[str, str], marks: Sequence[AnnotationEntry], count: int
) -> list[ShownQuestion]:
    """Propose at most `count` questions about a capture, or return those that were proposed at another time.

    keys: of the stages that the questions follow from, by stage. marks: those of the capture.

    Raises:
        StoreError: the store cannot be read.
    """
    work = held.work
    names = ("clusters", "labels", "silhouette")
    parameters = {name: getattr(work.parameters, name).model_dump(mode="json") for name in names}
    key = digest_of(
        {
            "questions": PROPOSALS_VERSION,
            "stages": dict(keys),
            "parameters": parameters,
            "readmission": has_readmission(work.capture.pose),
            "marks": [mark.model_dump(mode="json") for mark in marks],
            "count": count,
        }
    )
    kept = read_kept(work.location, work.object_id, key)
    if kept is not None:
        return [_shown(item) for item in kept]
    known = held.frames.marks(list(marks))
    proposed = held.propose(held.stored_labels(known) or held.label(known), known, count)
    # A store that cannot be written still has its questions.
    with suppress(StoreError):
        keep(work.location, work.object_id, key, [_values(item) for item in proposed])
    return proposed


def _values(shown: ShownQuestion) -> dict[str, Any]:
    question = shown.question
    nodes = {name: getattr(question, name).tolist() for name in ("layers", "rows", "columns")}
    place = {"frame": shown.frame, "x": shown.x, "y": shown.y}
    return place | nodes | {"exterior": question.exterior, "wrong": question.wrong, "change": question.change}


def _shown(values: Mapping[str, Any]) -> ShownQuestion:
    nodes = {name: np.array(values[name], dtype=int) for name in ("layers", "rows", "columns")}
    question = Question(**nodes, exterior=values["exterior"], wrong=values["wrong"], change=values["change"])
    return ShownQuestion(question, values["frame"], values["x"], values["y"])
