"""The worth of answers as a table in Markdown and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from glint.tasks.evaluation.questions import QuestionsEvaluation
from glint.tasks.evaluation.report import markdown_table

HEADS = (
    "capture",
    "answers",
    "before",
    "after",
    "change of data error",
    "random marks",
    "label wrong",
    "wrong or open",
)


def questions_table(evaluations: Sequence[QuestionsEvaluation]) -> str:
    """Return a table of errors before and after the answers, and of how many questions were worth asking."""
    rows = []
    for evaluation in evaluations:
        before, after, at_random = evaluation.before, evaluation.after, evaluation.random_marks
        count = len(evaluation.answers)
        rows.append(
            [
                evaluation.name,
                count,
                *(f"{data:.4f} / {whole:.4f}" for data, whole in (before, after)),
                f"{_change(before[0], after[0]):+.0%}",
                f"{at_random[0]:.4f} / {at_random[1]:.4f} ({_change(before[0], at_random[0]):+.0%})",
                f"{evaluation.wrong} of {count}",
                f"{evaluation.wrong_or_open} of {count}",
            ]
        )
    title = (
        "Worth of answers: squared error, data region / whole mask, before and after questions that the truth answers,"
        " and after as many marks at random places; questions about sheets whose label was wrong, or wrong or open."
    )
    return "\n".join(["", title, "", *markdown_table(HEADS, rows)]) + "\n"


def questions_as_json(evaluations: Sequence[QuestionsEvaluation]) -> dict[str, dict[str, Any]]:
    """Return the figures of each capture by its name, under the key `questions`."""
    return {
        evaluation.name: {
            "questions": {
                "before": evaluation.before,
                "after": evaluation.after,
                "random": evaluation.random_marks,
                "wrong": evaluation.wrong,
                "wrong or open": evaluation.wrong_or_open,
                "answers": [asdict(answer) for answer in evaluation.answers],
            }
        }
        for evaluation in evaluations
    }


def _change(before: float, after: float) -> float:
    """Return the relative change, 0 for no error before."""
    return after / before - 1.0 if before > 0 else 0.0
