"""Mark runs as crashed whose process has died; the server would otherwise show them as running forever.

Every local run, with its captures and stages, has a tag that names its process. A later run on the same machine looks
for tags of processes that have ended, and marks their runs as crashed. Results need no such care: a stage is stored
whole or not at all. Runs of deployments have heartbeats besides (`deployments.automations`), for other machines.
"""

import os
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from glint.flows.runtime.server_process import is_alive, process_start_time

RUN_TAG = "glint"
_PAGE = 200


@contextmanager
def tagged_with_process() -> Iterator[None]:
    """Tag the flow runs that are started inside with their process."""
    from prefect import tags

    with tags(RUN_TAG, process_tag()):
        yield


def process_tag() -> str:
    """Return the tag of this process: machine, pid and start time."""
    return _tag(os.getpid())


def mark_orphaned_crashed() -> int:
    """Mark open runs of ended processes of this machine as crashed; return the number of flow runs."""
    return _mark_crashed(
        lambda tags: any(_is_dead(tag) for tag in tags), "Its process ended; run again to go on from there."
    )


def mark_own_crashed() -> int:
    """Mark flow runs of this process as crashed whose end was lost while the server was unreachable.

    The server records the ends of tasks later than those of flows, so tasks are left to the next run.
    """
    mine = process_tag()
    return _mark_crashed(
        lambda tags: mine in tags,
        "The server was unreachable; see the run of its object for how it ended.",
        tasks=False,
    )


def _mark_crashed(is_orphaned: Callable[[Sequence[str]], bool], message: str, tasks: bool = True) -> int:
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
        FlowRunFilterTags,
        TaskRunFilter,
        TaskRunFilterState,
        TaskRunFilterStateType,
        TaskRunFilterTags,
    )
    from prefect.client.schemas.objects import State, StateType
    from prefect.states import Crashed

    crashed: State[Any] = Crashed(message=message)
    open_states = [StateType.RUNNING, StateType.PENDING, StateType.CANCELLING]
    flow_runs = FlowRunFilter(
        state=FlowRunFilterState(type=FlowRunFilterStateType(any_=open_states)), tags=FlowRunFilterTags(all_=[RUN_TAG])
    )
    task_runs = TaskRunFilter(
        state=TaskRunFilterState(type=TaskRunFilterStateType(any_=open_states)), tags=TaskRunFilterTags(all_=[RUN_TAG])
    )
    with get_client(sync_client=True) as client:
        matching = _pages(client.read_flow_runs, flow_run_filter=flow_runs)
        orphans = [run.id for run in matching if is_orphaned(run.tags)]
        if tasks:
            for run in list(_pages(client.read_task_runs, task_run_filter=task_runs)):
                if is_orphaned(run.tags):
                    client.set_task_run_state(run.id, crashed, force=True)
        for orphan in orphans:
            client.set_flow_run_state(orphan, crashed, force=True)
    return len(orphans)


def _pages(read: Callable[..., Sequence[Any]], **filters: Any) -> Iterator[Any]:
    """Yield all that a query finds, page by page."""
    start = 0
    while page := read(**filters, limit=_PAGE, offset=start):
        yield from page
        start += len(page)


def _tag(pid: int) -> str:
    return f"process {socket.gethostname()} {pid} {process_start_time(pid):.2f}"


def _is_dead(tag: str) -> bool:
    match tag.split():
        case ["process", host, pid, seconds] if host == socket.gethostname() and pid.isdigit():
            return not is_alive(int(pid), float(seconds))
    return False
