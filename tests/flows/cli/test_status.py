"""`glint status` says what the server knows: what runs, how far it is, what failed last and why."""

import json
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from prefect import flow, task
from prefect.artifacts import create_progress_artifact

from glint.flows.cli.status import failed_rows, running_rows, tell_status
from glint.flows.runtime.orphaned_runs import tagged_with_process
from glint.flows.runtime.prefect_server import Server, running_server
from glint.storage.errors import InputError

pytestmark = pytest.mark.server


def awaited[Found](look: Callable[[], Found], seconds: float = 30.0) -> Found:
    """What is found at last: the server records what a task run tells a second later."""
    deadline = time.monotonic() + seconds
    while not (found := look()) and time.monotonic() < deadline:
        time.sleep(0.2)
    return found


@task(name="capture", task_run_name="{name}", persist_result=False)
def pretended(name: str, good: bool) -> None:
    if not good:
        raise InputError("front.mp4 does not exist", "check the path")


@flow(name="object", persist_result=False)
def working_on(name: str, good: bool) -> None:
    with suppress(InputError):
        pretended(name, good)


def test_the_last_failures_are_told_with_their_remedies(
    server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, good in (("told/front", False), ("mended/front", False), ("mended/front", True)):
        with tagged_with_process():
            working_on(name, good)
    told = {("told/front", "front.mp4 does not exist: check the path")}
    assert awaited(lambda: {(row["capture"], row["why"]) for row in failed_rows()} >= told)
    assert awaited(lambda: "mended/front" not in {row["capture"] for row in failed_rows()})
    tell_status(str(tmp_path), as_json=True)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {"kind": "failed", "capture": "told/front"}.items() <= next(
        e for e in lines if e["capture"] == "told/front"
    ).items()
    tell_status(str(tmp_path), as_json=False)
    shown = capsys.readouterr().out
    assert "no objects yet" in shown and "check the path" in shown and server.ui_url in shown


def test_what_runs_is_told_with_its_progress(server: Server) -> None:
    reached, seen = threading.Event(), threading.Event()

    @task(name="capture", task_run_name="running/front", persist_result=False)
    def pretended() -> None:
        create_progress_artifact(42.0, key="running-front", description="clusters")
        reached.set()
        seen.wait(60)

    @flow(name="object", persist_result=False)
    def working() -> None:
        pretended()

    def work() -> None:
        with server.connected(), tagged_with_process():
            working()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert reached.wait(60)
        row = awaited(lambda: next((each for each in running_rows() if each["running"] == "running/front"), None))
    finally:
        seen.set()
        thread.join()
    assert (row["of"], row["stage"], row["progress"]) == ("capture", "clusters", "42%") and row["since"]
    assert awaited(lambda: not [each for each in running_rows() if each["running"] == "running/front"])


def test_no_server_is_started_to_ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    assert running_server(tmp_path) is None and not list(tmp_path.iterdir())
