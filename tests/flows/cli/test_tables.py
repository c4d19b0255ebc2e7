"""The table of a run, and its rows for programs."""

from types import SimpleNamespace
from typing import Any, cast

from glint.flows.cli.tables import run_table, show, summary_json
from glint.flows.pipeline.run import Summary
from glint.flows.results import CaptureResult, ObjectResult, RunResult
from glint.tasks.engine.stage import StageRecord

COUNTS: dict[str, dict[str, float]] = {
    "frames": {"frames": 8000},
    "lights": {"accepted": 7810},
    "mask": {"object pixels": 300},
    "labels": {"observed pixels": 100, "confident share": 0.25},
}
RECORDS = tuple(StageRecord(stage, "k", False, 1.0, counts, ()) for stage, counts in COUNTS.items())


def summary() -> Summary:
    """One capture that succeeded, and one that failed."""
    captures = (
        CaptureResult("glass", "front", 13.5, RECORDS),
        CaptureResult("glass", "back", 0.5, (), "dark", "light it"),
    )
    version = cast(Any, SimpleNamespace(name="v2"))
    return Summary(RunResult("run", (ObjectResult("glass", captures, version),), 14.0), "http://127.0.0.1:4200")


def test_programs_get_numbers_and_null() -> None:
    front, back = summary_json(summary())["captures"]
    assert (front["version"], front["frames"], front["lights"]) == ("v2", 8000, 7810)
    assert (front["observed"], front["confident"]) == (0.3333, 0.25)
    assert {back[name] for name in ("version", "frames", "lights", "observed", "confident")} == {None}
    assert (back["error"], back["remedy"]) == ("dark", "light it")


def test_people_get_percent_and_blanks(capsys: Any) -> None:
    show(run_table(summary()))
    _, front, back = capsys.readouterr().out.splitlines()
    assert front.split() == ["glass/front", "done", "v2", "8,000", "7,810", "33%", "25%", "0", "13.5"]
    assert back.split() == ["glass/back", "failed", "0", "0.5"]
