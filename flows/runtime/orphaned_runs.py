"""Runs whose process died without a word: the server would show them as running for ever.

Every run carries the process that performs it as a tag. A later run on the same machine looks for tags of processes
that are no more, and marks those runs as crashed. Results need no such care: a stage is there or it is not.
"""

import os
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from glint.flows.runtime.processes import born, is_alive

RUN_TAG = "glint"
_PAGE = 200


@contextmanager
def tagged_with_process() -> Iterator[None]:
    """Tag the flow runs that are started inside with their process."""
    from prefect import tags

    with tags(RUN_TAG, process_tag()):
        yield


def process_tag() -> str:
    """This process by machine, number and start."""
    return _tag(os.getpid())


def mark_orphaned_crashed() -> int:
    """Mark as crashed what dead processes of this machine have left open; how many flow runs that were."""
    return _close(lambda tags: any(_is_dead(tag) for tag in tags), "Its process ended; run again to go on from there.")


def mark_own_crashed() -> int:
    """Mark as crashed the flow runs of this process whose end a server that was away did not hear of.

    Of tasks the server hears later than of flows; the next run looks after those.
    """
    mine = process_tag()
    return _close(lambda tags: mine in tags, "The server was away; its object's run tells how it ended.", tasks=False)


def _close(is_over: Callable[[Sequence[str]], bool], why: str, tasks: bool = True) -> int:
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

    crashed: State[Any] = Crashed(message=why)
    still_open = [StateType.RUNNING, StateType.PENDING, StateType.CANCELLING]
    flow_runs = FlowRunFilter(
        state=FlowRunFilterState(type=FlowRunFilterStateType(any_=still_open)), tags=FlowRunFilterTags(all_=[RUN_TAG])
    )
    task_runs = TaskRunFilter(
        state=TaskRunFilterState(type=TaskRunFilterStateType(any_=still_open)), tags=TaskRunFilterTags(all_=[RUN_TAG])
    )
    with get_client(sync_client=True) as client:
        flows = [each.id for each in _pages(client.read_flow_runs, flow_run_filter=flow_runs) if is_over(each.tags)]
        if tasks:
            for each in list(_pages(client.read_task_runs, task_run_filter=task_runs)):
                if is_over(each.tags):
                    client.set_task_run_state(each.id, crashed, force=True)
        for flow in flows:
            client.set_flow_run_state(flow, crashed, force=True)
    return len(flows)


def _pages(read: Callable[..., Sequence[Any]], **filters: Any) -> Iterator[Any]:
    """All that a query finds, page by page."""
    start = 0
    while page := read(**filters, limit=_PAGE, offset=start):
        yield from page
        start += len(page)


def _tag(pid: int) -> str:
    return f"process {socket.gethostname()} {pid} {born(pid):.2f}"


def _is_dead(tag: str) -> bool:
    match tag.split():
        case ["process", host, pid, seconds] if host == socket.gethostname() and pid.isdigit():
            return not is_alive(int(pid), float(seconds))
    return False
