"""A capture in one row: verdict, warnings, shares and the last stage, from records alone."""

from typing import Any

import pytest

from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.pipeline import NAMES
from glint.tasks.review.summary import summary_of


def records(*warnings: StageWarning, observed: int = 700, stages: tuple[str, ...] = tuple(NAMES)) -> dict[str, Any]:
    """Records of a capture of 1,000 pixels, each stage of 2 s."""
    made: dict[str, Any] = {stage: ("key", {"seconds": 2.0, "counts": {}, "warnings": []}) for stage in stages}
    counts = {
        "frames": {"frames": 900},
        "mask": {"object pixels": 1000},
        "clusters": {"observed pixels": observed},
        "labels": {"confident share": 0.4},
    }
    for stage in made:
        made[stage][1]["counts"] = counts.get(stage, {})
    made["survey"][1]["warnings"] = [warning.to_json() for warning in warnings]
    return made


def test_a_capture_without_fault_is_good() -> None:
    summary = summary_of(records())
    assert str(summary.verdict) == "good" and not summary.is_doubtful
    assert (summary.confident, summary.observed, summary.stage) == (0.4, 0.7, NAMES[-1])


@pytest.mark.parametrize(
    ("cost", "word", "doubtful"), [(6.0, "needs a sphere", True), (2.0, "usable", False), (0.5, "good", False)]
)
def test_a_dear_warning_asks_for_its_cause(cost: float, word: str, doubtful: bool) -> None:
    summary = summary_of(records(StageWarning("the sphere lies elsewhere: correct it", "sphere", cost)))
    assert summary.verdict is not None and summary.verdict.word == word
    assert summary.is_doubtful == doubtful
    assert summary.warnings[0].cause == "sphere"


def test_few_highlights_are_said_without_a_share_that_was_not_compared() -> None:
    summary = summary_of(records(observed=10))
    assert summary.verdict is not None
    assert str(summary.verdict) == "record again: highlights on 1% of the object"


def test_before_the_clusters_there_is_no_verdict() -> None:
    summary = summary_of(records(stages=("survey", "frames", "lights")))
    assert summary.verdict is None and summary.confident is None and summary.stage == "lights"
    nothing = summary_of({})
    assert nothing.verdict is None and nothing.stage == ""
