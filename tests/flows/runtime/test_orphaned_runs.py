import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from glint.flows.runtime.orphaned_runs import _is_dead, _tag, mark_orphaned_crashed, process_tag
from glint.flows.runtime.prefect_server import Server
from tests.prefect_api import ask

pytestmark = pytest.mark.server

RUN = """
import os, sys, time
from pathlib import Path
from glint.flows.runtime.prefect_server import start_server
server = start_server(Path(sys.argv[1]))
from prefect import flow, task
from glint.flows.runtime.orphaned_runs import tagged_with_process

@task
def wait():
    print("ready", flush=True)
    time.sleep(60)

@flow
def inner():
    wait()

@flow
def outer():
    inner()

with server.connected(), tagged_with_process():
    outer()
"""


def states_of(server: Server, kind: str, tag: str) -> list[str]:
    asked = {f"{kind}s": {"tags": {"all_": [tag]}}}
    found: list[dict[str, Any]] = ask(f"{server.api_url}/{kind}s/filter", asked)
    return sorted(each["state"]["type"] for each in found)


def test_runs_of_a_killed_process_are_closed(server: Server, glint_home: Path, tmp_path: Path) -> None:
    (tmp_path / "run.py").write_text(RUN)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "run.py"), str(glint_home)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    tag = _tag(process.pid)
    assert states_of(server, "flow_run", tag) == ["RUNNING", "RUNNING"]
    deadline = time.monotonic() + 30
    while "RUNNING" not in states_of(server, "task_run", tag):
        assert time.monotonic() < deadline, "the task was never recorded"
        time.sleep(0.1)
    mark_orphaned_crashed()
    assert states_of(server, "flow_run", tag) == ["RUNNING", "RUNNING"]
    process.kill()
    process.wait(20)
    assert mark_orphaned_crashed() == 2
    assert states_of(server, "flow_run", tag) == ["CRASHED", "CRASHED"]
    assert set(states_of(server, "task_run", tag)) == {"CRASHED"}
    assert mark_orphaned_crashed() == 0


def test_only_processes_of_this_machine_are_judged() -> None:
    mine = process_tag()
    assert not _is_dead(mine)
    word, host, pid, created = mine.split()
    assert _is_dead(f"{word} {host} {pid} {float(created) - 60:.2f}")
    assert not _is_dead(f"{word} elsewhere {pid} 1.00")
    assert not _is_dead("something else")
