import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from glint.flows.runtime.orphaned_runs import _is_dead, _tag, mark_orphaned_crashed, process_tag
from glint.flows.runtime.prefect_server import Server
from tests.polling import PATIENCE, until
from tests.prefect_api import ask

pytestmark = pytest.mark.server

RUN = """
import os, sys, time
from pathlib import Path
from glint.flows.runtime.prefect_server import start_server
server = start_server(Path(sys.argv[1]))
from prefect import flow, task
from glint.flows.runtime.orphaned_runs import tagged_with_process, untagged_tasks

@task
def wait():
    print("ready", flush=True)
    time.sleep(60)

@flow
def inner():
    with untagged_tasks():
        wait()

@flow
def outer():
    inner()

with server.connected(), tagged_with_process():
    outer()
"""


def runs_of(server: Server, kind: str, tag: str) -> list[dict[str, Any]]:
    """Flow runs with a tag, or the task runs in them, which have none."""
    asked = {"flow_runs": {"tags": {"all_": [tag]}}}
    found: list[dict[str, Any]] = ask(f"{server.api_url}/{kind}s/filter", asked)
    return found


def state_of(run: dict[str, Any]) -> str:
    """Type of a run's state, empty before its first: a task run is recorded before the states it went through."""
    return "" if run["state"] is None else str(run["state"]["type"])


def states_of(server: Server, kind: str, tag: str) -> list[str]:
    return sorted(map(state_of, runs_of(server, kind, tag)))


def waiting_states(server: Server, tag: str) -> list[str]:
    """States of the runs of the task `wait`; the run of the flow inside is a task run too."""
    return [state_of(run) for run in runs_of(server, "task_run", tag) if run["name"].startswith("wait")]


def started(glint_home: Path, folder: Path) -> "subprocess.Popen[str]":
    """Start the flows of RUN; return their process when its task runs."""
    (folder / "run.py").write_text(RUN)
    process = subprocess.Popen(
        [sys.executable, str(folder / "run.py"), str(glint_home)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def test_runs_of_a_killed_process_are_closed(server: Server, glint_home: Path, tmp_path: Path) -> None:
    process = started(glint_home, tmp_path)
    tag = _tag(process.pid)
    assert states_of(server, "flow_run", tag) == ["RUNNING", "RUNNING"]
    until(lambda: waiting_states(server, tag) == ["RUNNING"])
    mark_orphaned_crashed()
    assert states_of(server, "flow_run", tag) == ["RUNNING", "RUNNING"]
    process.kill()
    process.wait(PATIENCE)
    assert mark_orphaned_crashed() == 2
    assert states_of(server, "flow_run", tag) == ["CRASHED", "CRASHED"]
    assert set(states_of(server, "task_run", tag)) == {"CRASHED"}
    assert mark_orphaned_crashed() == 0


def test_what_is_recorded_after_the_kill_is_closed_by_the_next_run(
    server: Server, glint_home: Path, tmp_path: Path
) -> None:
    process = started(glint_home, tmp_path)
    tag = _tag(process.pid)
    process.kill()
    process.wait(PATIENCE)
    mark_orphaned_crashed()
    assert states_of(server, "flow_run", tag) == ["CRASHED", "CRASHED"]
    # Events are recorded each second, also those that were sent before the kill: how many these are is not known.
    time.sleep(5.0)
    until(lambda: mark_orphaned_crashed() == 0 and set(states_of(server, "task_run", tag)) <= {"CRASHED"})


def test_only_processes_of_this_machine_are_judged() -> None:
    mine = process_tag()
    assert not _is_dead(mine)
    word, host, pid, created = mine.split()
    assert _is_dead(f"{word} {host} {pid} {float(created) - 60:.2f}")
    assert not _is_dead(f"{word} elsewhere {pid} 1.00")
    for strange in ("something else", f"{word} {host} ² 1.00", f"{word} {host} {pid} soon", f"{word} {host} {pid} nan"):
        assert not _is_dead(strange)
