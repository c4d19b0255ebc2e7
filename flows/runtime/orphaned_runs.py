"""Mark runs as crashed whose process has died; the server would otherwise show them as running forever.

Every local flow run has a tag that names its process. A later run on the same machine looks for tags of processes that
have ended, and marks their flow runs as crashed, with the captures and stages in them, which have no tags: Prefect asks
the server for the concurrency limits of each tag of a task run. Results need no such care: a stage is stored
whole or not at all. Runs of deployments have heartbeats besides (`deployments.automations`), for other machines.
"""

import os
import re
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from glint.flows.runtime.server_process import is_alive, process_start_time

if TYPE_CHECKING:
    from prefect.client.orchestration import SyncPrefectClient
    from prefect.client.schemas.objects import StateType

RUN_TAG = "glint"
_PAGE = 200
_PROCESS_TAG = re.compile(r"process (\S+) (\d{1,10}) (-?\d+\.\d\d)", re.ASCII)
"""Machine, pid and start time; any other tag, from whomever, names no process."""

IsOrphaned = Callable[[Sequence[str]], bool]
"""Whether the tags of a flow run name a process that has died."""


@contextmanager
def tagged_with_process() -> Iterator[None]:
    """Tag the flow runs that are started inside with their process."""
    from prefect import tags

    with tags(RUN_TAG, process_tag()):
        yield


@contextmanager
def untagged_tasks() -> Iterator[None]:
    """Let task runs that start inside have no tags: their flow run has them."""
    from prefect.context import TagsContext

    with TagsContext(current_tags=set()):
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


def _mark_crashed(is_orphaned: IsOrphaned, message: str, tasks: bool = True) -> int:
    """Mark open flow runs whose tags are orphaned, and task runs in such flow runs; return the number of flow runs."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.objects import State
    from prefect.states import Crashed

    crashed: State[Any] = Crashed(message=message)
    with get_client(sync_client=True) as client:
        flow_runs = _orphaned_flow_runs(client, is_orphaned)
        for run in _orphaned_task_runs(client, is_orphaned) if tasks else ():
            client.set_task_run_state(run.id, crashed, force=True)
        for run in flow_runs:
            client.set_flow_run_state(run.id, crashed, force=True)
    return len(flow_runs)


def _orphaned_flow_runs(client: "SyncPrefectClient", is_orphaned: IsOrphaned) -> list[Any]:
    """Return the open flow runs whose tags are orphaned."""
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
        FlowRunFilterTags,
    )

    is_open = FlowRunFilterState(type=FlowRunFilterStateType(any_=_open_states()))
    open_runs = FlowRunFilter(state=is_open, tags=FlowRunFilterTags(all_=[RUN_TAG]))
    return [run for run in _pages(client.read_flow_runs, flow_run_filter=open_runs) if is_orphaned(run.tags)]


def _orphaned_task_runs(client: "SyncPrefectClient", is_orphaned: IsOrphaned) -> list[Any]:
    """Return the open task runs in flow runs, open or not, whose tags are orphaned."""
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterId,
        FlowRunFilterTags,
        TaskRunFilter,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )

    task_runs = list(
        _pages(
            client.read_task_runs,
            flow_run_filter=FlowRunFilter(tags=FlowRunFilterTags(all_=[RUN_TAG])),
            task_run_filter=TaskRunFilter(state=TaskRunFilterState(type=TaskRunFilterStateType(any_=_open_states()))),
        )
    )
    ids = list({run.flow_run_id for run in task_runs})
    orphaned = {
        run.id
        for start in range(0, len(ids), _PAGE)
        for run in client.read_flow_runs(
            flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=ids[start : start + _PAGE])), limit=_PAGE
        )
        if is_orphaned(run.tags)
    }
    return [run for run in task_runs if run.flow_run_id in orphaned]


def _open_states() -> "list[StateType]":
    from prefect.client.schemas.objects import StateType

    return [StateType.RUNNING, StateType.PENDING, StateType.CANCELLING]


def _pages(read: Callable[..., Sequence[Any]], **filters: Any) -> Iterator[Any]:
    """Yield all that a query finds, page by page."""
    start = 0
    while page := read(**filters, limit=_PAGE, offset=start):
        yield from page
        start += len(page)


def _tag(pid: int) -> str:
    return f"process {socket.gethostname()} {pid} {process_start_time(pid):.2f}"


def _is_dead(tag: str) -> bool:
    named = _PROCESS_TAG.fullmatch(tag)
    return named is not None and named[1] == socket.gethostname() and not is_alive(int(named[2]), float(named[3]))
