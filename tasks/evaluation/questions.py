"""The worth of answers: errors before and after questions that the truth answers, beside random marks."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from glint.storage.inputs.markup import AnnotationEntry
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.questions.proposals import Question
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.evaluation.truth import load_truth
from glint.tasks.questions.capture_questions import CaptureQuestions

TRUE_SHEET_DEG, FALSE_SHEET_DEG = 5.0, 10.0
"""Median angle of a sheet's candidates to the true normals below which the oracle calls the sheet true, and from which
it calls it false: between them the outer surface may be read with an error of lights or camera, and it skips."""
PROPOSED_PER_ANSWER = 2
"""Proposals for each answer, since some are skipped."""
RANDOM_SEED = 0
"""Seed of the marks at random places."""
RANDOM_TRIALS = 50
"""Random places tried for each mark before the capture counts as without highlights."""

Errors = tuple[float, float]
"""Squared errors over the observed region and over the whole mask."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answered question: pixels of its sheet, its label before, the oracle's answer, and the errors after it.

    probability: that the label was wrong, by the program itself. open: whether the program called the label open.
    errors: of the draft that the review page shows, with this answer and those before it.
    """

    pixels: int
    labelled: bool
    truth: bool
    probability: float
    open: bool
    errors: Errors


@dataclass(frozen=True, slots=True)
class QuestionsEvaluation:
    """Worth of answers of a capture: errors before, after the answers, and after as many marks at random places.

    skipped: questions that the oracle did not answer.
    """

    name: str
    before: Errors
    after: Errors
    answers: tuple[Answer, ...]
    random_marks: Errors
    skipped: int = 0

    @property
    def wrong(self) -> int:
        """Number of questions whose sheet had the wrong label."""
        return sum(answer.labelled != answer.truth for answer in self.answers)

    @property
    def wrong_or_open(self) -> int:
        """Number of questions whose sheet had the wrong label or an open one."""
        return sum(answer.labelled != answer.truth or answer.open for answer in self.answers)


def evaluate_questions(work: CaptureContext, count: int) -> QuestionsEvaluation | None:
    """Ask `count` questions, as the review page does, answered from the truth; None without true normals.

    The marks of the catalogue are left out: answers are what is measured.

    Raises:
        InputError: the truth is unusable; StoreError: the capture was not run.
    """
    if work.capture.truth is None:
        return None
    questions = CaptureQuestions(work)
    mask = questions.mask
    known = load_truth(work, mask.shape)
    if known is None:
        return None
    truth = known.normals

    def errors_with(marks: Marks | None) -> Errors:
        return _errors(questions, questions.label(marks).normals, truth)

    result = questions.label(None)
    before = _errors(questions, result.normals, truth)
    annotations: list[AnnotationEntry] = []
    answers: list[Answer] = []
    skipped = 0
    for shown in questions.propose(result, None, PROPOSED_PER_ANSWER * count):
        is_true = oracle(shown.question, questions.clusters.normals, truth)
        if is_true is None:
            skipped += 1
            continue
        annotations.append(shown.answer(is_true))
        question, draft = shown.question, questions.draft_normals(questions.frames.marks(annotations))
        errors = _errors(questions, draft, truth)
        answers.append(Answer(len(question.rows), question.exterior, is_true, question.wrong, question.is_open, errors))
        if len(answers) == count:
            break
    after = errors_with(questions.frames.marks(annotations))
    at_random = random_annotations(questions, truth, len(answers))
    return QuestionsEvaluation(
        work.name, before, after, tuple(answers), errors_with(questions.frames.marks(at_random)), skipped
    )


def oracle(question: Question, normals: np.ndarray, truth: np.ndarray) -> bool | None:
    """Return whether a sheet of candidates (K, H, W, 3) is the surface of which `truth` (H, W, 3) are the normals.

    None: it cannot be said.
    """
    at = question.rows, question.columns
    error = angles(normals[question.layers, *at], truth[at])
    known = np.isfinite(error)
    median = float(np.median(error[known])) if known.any() else TRUE_SHEET_DEG
    return None if TRUE_SHEET_DEG <= median < FALSE_SHEET_DEG else median < TRUE_SHEET_DEG


def random_annotations(questions: CaptureQuestions, truth: np.ndarray, count: int) -> list[AnnotationEntry]:
    """Return `count` annotations at random candidates (seeded), each true or false as the truth says."""
    rng = np.random.default_rng(RANDOM_SEED)
    normals, region = questions.clusters.normals, questions.geometry.region
    layers, rows, columns = np.nonzero(np.isfinite(normals[..., 0]) & questions.mask)
    annotations: list[AnnotationEntry] = []
    for node in rng.permutation(len(rows))[: RANDOM_TRIALS * count]:
        if len(annotations) == count:
            break
        single = Question(layers[[node]], rows[[node]], columns[[node]], False, 0.0, 0.0)
        frame, is_true = questions.frame_of(single), oracle(single, normals, truth)
        if frame is not None and is_true is not None:
            kind: Literal["true", "false"] = "true" if is_true else "false"
            x, y = float(columns[node] + region.x), float(rows[node] + region.y)
            annotations.append(AnnotationEntry(frame=frame, x=x, y=y, kind=kind))
    return annotations


def _errors(questions: CaptureQuestions, normals: np.ndarray, truth: np.ndarray) -> Errors:
    observed = questions.mask & (questions.clusters.observations > 0)
    return squared_errors(normals, truth, observed), squared_errors(normals, truth, questions.mask)
