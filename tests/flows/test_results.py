"""Results of captures, and the final states of the flow runs that processed them."""

from dataclasses import replace

import pytest

from glint.flows.results import CaptureResult, final_state, result_of, without_models
from glint.storage.catalogue.models import MODEL
from glint.tasks.engine.stage import StageRecord

DONE = CaptureResult("glass", "front", 1.0)
FAILED = CaptureResult("glass", "back", 1.0, (), "no light in any frame", "film again")


def record(stage: str, cached: bool) -> StageRecord:
    return StageRecord(stage, "key", cached, 0.1, {"frames": 7.0}, ())


def test_a_capture_is_up_to_date_where_every_stage_was() -> None:
    assert (DONE.outcome, FAILED.outcome, DONE.name) == ("done", "failed", "glass/front")
    stored = replace(DONE, records=(record("survey", True), record("mask", True)))
    assert stored.outcome == "up to date"
    assert replace(DONE, records=(record("survey", True), record("mask", False))).outcome == "done"
    assert stored.count("mask", "frames") == 7.0
    assert stored.count("mask", "other") is stored.count("depth", "frames") is None
    assert without_models([DONE, replace(DONE, capture_id=MODEL)]) == [DONE]


@pytest.mark.parametrize(
    ("captures", "name"),
    [([DONE], "Completed"), ([DONE, FAILED], "PartiallyCompleted"), ([FAILED, FAILED], "Failed")],
)
def test_a_run_has_failed_where_all_of_its_captures_did(captures: list[CaptureResult], name: str) -> None:
    state = final_state(captures, "all done", "the result")
    assert state.name == name and state.is_failed() == (FAILED in captures)
    failures = captures.count(FAILED)
    says = f"{failures} of {len(captures)} captures failed; glass/back: no light in any frame -> film again"
    assert state.message == (says if failures else "all done")
    assert result_of(state) == "the result"


def test_what_ended_a_run_instead_of_a_result_is_raised() -> None:
    for error in (ValueError("broken"), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            result_of(final_state([FAILED], "", error))
