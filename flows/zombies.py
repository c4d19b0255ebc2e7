"""Runs whose process died without a word: the server would show them as running for ever.

Every run carries the process that performs it as a tag. A later run on the same machine looks for tags of processes
that are no more, and marks those runs as crashed. Results need no such care: a stage is there or it is not.
"""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flows.processes import born, is_alive

RUN_TAG = "glint"


@contextmanager
def tagged() -> Iterator[None]:
    """Tag the flow runs that are started inside with their process."""
    from prefect import tags

    with tags(RUN_TAG, process_tag()):
        yield


def process_tag() -> str:
    """This process by machine, number and start."""
    return _tag(os.getpid())


def close_runs_of_the_dead() -> int:
    """Mark as crashed what dead processes of this machine have left open; how many flow runs that were."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterId,
        FlowRunFilterState,
        FlowRunFilterStateType,
        FlowRunFilterTags,
        TaskRunFilter,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )
    from prefect.client.schemas.objects import State, StateType
    from prefect.states import Crashed

    crashed: State[Any] = Crashed(message="Its process ended; run again to go on where it stopped.")
    still_open = [StateType.RUNNING, StateType.PENDING, StateType.CANCELLING]
    with get_client(sync_client=True) as client:
        open_runs = client.read_flow_runs(
            flow_run_filter=FlowRunFilter(
                state=FlowRunFilterState(type=FlowRunFilterStateType(any_=still_open)),
                tags=FlowRunFilterTags(all_=[RUN_TAG]),
            )
        )
        dead = [run.id for run in open_runs if any(_is_dead(tag) for tag in run.tags)]
        if not dead:
            return 0
        open_tasks = client.read_task_runs(
            flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=dead)),
            task_run_filter=TaskRunFilter(state=TaskRunFilterState(type=TaskRunFilterStateType(any_=still_open))),
        )
        for task in open_tasks:
            client.set_task_run_state(task.id, crashed, force=True)
        for run in dead:
            client.set_flow_run_state(run, crashed, force=True)
    return len(dead)


def _tag(pid: int) -> str:
    return f"process {socket.gethostname()} {pid} {born(pid):.2f}"


def _is_dead(tag: str) -> bool:
    match tag.split():
        case ["process", host, pid, seconds] if host == socket.gethostname() and pid.isdigit():
            return not is_alive(int(pid), float(seconds))
    return False
