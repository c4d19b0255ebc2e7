"""The worth of answers on a simulated capture."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.tasks.algorithms.questions.proposals import Question
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.evaluation.questions import Answer, QuestionsEvaluation, evaluate_questions, oracle
from glint.tasks.evaluation.questions_report import questions_as_json, questions_table
from tests.tasks.make_context import make_context


@pytest.fixture(scope="module")
def work(simulated: Path, performed: Path, tmp_path_factory: pytest.TempPathFactory) -> CaptureContext:
    store = tmp_path_factory.mktemp("questions") / "store"
    shutil.copytree(performed, store)
    return make_context(simulated, store)


@pytest.mark.usefixtures("smooth_labels")
def test_questions_are_answered_from_the_truth(work: CaptureContext) -> None:
    evaluation = evaluate_questions(work, 1)
    assert evaluation is not None and evaluation.name == "hemisphere/front"
    assert len(evaluation.answers) == 1
    assert evaluation.after == pytest.approx(evaluation.answers[-1].errors, rel=0.2)
    assert 0.0 < evaluation.before[0] < 0.05
    assert evaluation.after[0] < 1.2 * evaluation.before[0]


def test_a_capture_without_truth_asks_nothing(work: CaptureContext) -> None:
    assert evaluate_questions(replace(work, capture=work.capture.model_copy(update={"truth": None})), 2) is None


@pytest.mark.parametrize(("tilt_deg", "answer"), [(3.0, True), (7.0, None), (12.0, False)])
def test_the_oracle_answers_from_the_truth(tilt_deg: float, answer: bool | None) -> None:
    truth = np.full((2, 3, 3), (0.0, 0.0, 1.0))
    tilt = np.radians(tilt_deg)
    normals = np.full((1, 2, 3, 3), (np.sin(tilt), 0.0, np.cos(tilt)))
    index = np.arange(2)
    assert oracle(Question(0 * index, index, index, True, 0.5, 1.0), normals, truth) is answer


def test_the_table_counts_what_was_wrong_or_open() -> None:
    answers = (
        Answer(9, True, False, 0.1, False, (0.03, 0.05)),
        Answer(8, True, True, 0.4, True, (0.02, 0.04)),
        Answer(7, False, False, 0.05, False, (0.02, 0.04)),
    )
    evaluation = QuestionsEvaluation("a/front", (0.04, 0.06), (0.02, 0.04), answers, (0.05, 0.06))
    table = questions_table([evaluation])
    assert (
        "| a/front | 3 | 0.0400 / 0.0600 | 0.0200 / 0.0400 | -50% | 0.0500 / 0.0600 (+25%) | 1 of 3 | 2 of 3 |" in table
    )
    facts = questions_as_json([evaluation])["a/front"]["questions"]
    assert facts["wrong"] == 1 and facts["wrong or open"] == 2 and len(facts["answers"]) == 3
