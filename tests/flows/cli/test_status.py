"""`glint status` shows running captures with their progress, and the last failures with their remedies."""

import json
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from prefect import flow, task
from prefect.artifacts import create_progress_artifact

from glint.flows.cli.status import status
from glint.flows.pipeline import prefect_sink
from glint.flows.pipeline.prefect_sink import PrefectSink
from glint.flows.reporting.events import StageStarted
from glint.flows.reporting.flow_runs import failed_rows, running_rows
from glint.flows.runtime.orphaned_runs import tagged_with_process
from glint.flows.runtime.prefect_server import Server, running_server
from glint.storage.errors import InputError
from tests.polling import PATIENCE, until

pytestmark = pytest.mark.server


@task(name="capture", task_run_name="{name}", persist_result=False)
def fake_capture(name: str, good: bool) -> None:
    if not good:
        raise InputError("front.mp4 does not exist", "check the path")


@flow(name="object", persist_result=False)
def fake_object(name: str, good: bool, store: str) -> None:
    with suppress(InputError):
        fake_capture(name, good)


def test_the_last_failures_are_shown_with_their_remedies(
    server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(name: str, good: bool, store: str) -> None:
        with tagged_with_process():
            fake_object(name, good, store)

    def failed() -> dict[str, str]:
        return {row["capture"]: row["error"] for row in failed_rows(str(tmp_path))}

    run("elsewhere/front", False, "/another/store")
    for name in ("broken/front", "fixed/front"):
        run(name, False, str(tmp_path))
    until(lambda: set(failed()) == {"broken/front", "fixed/front"})
    run("fixed/front", True, str(tmp_path))
    until(lambda: failed() == {"broken/front": "front.mp4 does not exist: check the path"})
    until(lambda: not running_rows(str(tmp_path)))
    status(str(tmp_path), as_json=True)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(line["kind"], line["capture"]) for line in lines] == [("failed", "broken/front")]
    status(str(tmp_path), as_json=False)
    shown = capsys.readouterr().out
    assert "elsewhere" not in shown
    assert "no objects in the store" in shown and "check the path" in shown and server.ui_url in shown


def test_running_captures_are_shown_with_their_progress(server: Server, tmp_path: Path) -> None:
    reached, released = threading.Event(), threading.Event()

    @task(name="capture", task_run_name="running/front", persist_result=False)
    def fake_capture() -> None:
        create_progress_artifact(42.0, key="running-front", description="clusters")
        reached.set()
        released.wait(PATIENCE)

    @flow(name="object", persist_result=False)
    def fake_object(store: str) -> None:
        fake_capture()

    def work() -> None:
        with server.connected(), tagged_with_process():
            fake_object(str(tmp_path))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert reached.wait(PATIENCE)
        row = until(lambda: next((row for row in running_rows(str(tmp_path)) if row["progress"] == "42%"), None))
    finally:
        released.set()
        thread.join()
    assert (row["running"], row["type"], row["stage"]) == ("running/front", "capture", "clusters") and row["since"]
    until(lambda: not running_rows(str(tmp_path)))


def test_the_stage_of_a_running_and_of_a_failed_capture_is_shown(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prefect_sink, "RUNNING_SECONDS", 0.0)
    running: list[dict[str, Any] | None] = []

    def running_row() -> dict[str, Any] | None:
        rows = [row for row in running_rows(str(tmp_path)) if row["running"] == "staged/front" and row["stage"]]
        return rows[0] if rows else None

    @task(name="capture", task_run_name="staged/front", persist_result=False)
    def fake_capture(sink: PrefectSink) -> None:
        with sink.attach("staged/front"):
            sink.emit(StageStarted("staged/front", "labels"))
            running.append(until(running_row))
            raise InputError("front.mp4 does not exist", "check the path")

    @flow(name="object", persist_result=False)
    def fake_object(store: str) -> None:
        with suppress(InputError), PrefectSink() as sink:
            fake_capture(sink)

    fake_object(str(tmp_path))

    def failed_stage() -> str:
        return "".join(row["stage"] for row in failed_rows(str(tmp_path)) if row["capture"] == "staged/front")

    assert running[0] is not None and running[0]["stage"] == "labels"
    assert until(failed_stage) == "labels"


def test_status_starts_no_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    assert running_server(tmp_path) is None and not list(tmp_path.iterdir())
