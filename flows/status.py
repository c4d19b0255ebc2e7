"""`glint status`: what the dashboard shows, on a terminal: objects, what runs and how far it is, what failed, why."""

import json
from collections.abc import Iterable
from typing import Any

import typer

from flows.server import running_server
from flows.tables import show, status_rows, table_of

LATEST = 200
"""Capture runs that are looked at, the newest ones."""

_PREFIX = "Flow run encountered an exception: "


def tell_status(store: str, as_json: bool) -> None:
    """Print objects of the store, and of the server, if one is up, what runs and which captures failed last."""
    objects = status_rows(store)
    server = running_server()
    running, failed = list[dict[str, Any]](), list[dict[str, Any]]()
    if server is not None:
        from flows.zombies import close_runs_of_the_dead

        with server.reached():
            close_runs_of_the_dead()
            running, failed = running_rows(), failed_rows()
    if as_json:
        for kind, rows in (("object", objects), ("running", running), ("failed", failed)):
            for row in rows:
                typer.echo(json.dumps({"kind": kind, **row}, default=str))
        return
    show(table_of(objects, "no objects yet: glint run CATALOGUE"))
    if running:
        typer.echo()
        show(table_of(running, ""))
    for row in failed:
        typer.echo()
        typer.secho(f"{row['capture']} failed at {row['ended']}: {row['why']}", fg="red")
    if server is not None:
        typer.echo(f"\ndashboard: {server.ui_url}")


def running_rows() -> list[dict[str, Any]]:
    """One row for each run of a catalogue, and for each capture that is worked on: stage, progress, since when."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import (
        ArtifactFilter,
        ArtifactFilterTaskRunId,
        FlowRunFilter,
        FlowRunFilterId,
        TaskRunFilter,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )
    from prefect.client.schemas.objects import StateType

    rows = []
    with get_client(sync_client=True) as client:
        for flow in ("catalogue", "maintenance", "capture"):
            runs = _runs(client, flow, [StateType.RUNNING])
            if not runs:
                continue
            tasks = client.read_task_runs(
                flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=[each.id for each in runs])),
                task_run_filter=TaskRunFilter(
                    state=TaskRunFilterState(type=TaskRunFilterStateType(any_=[StateType.RUNNING]))
                ),
            )
            stages = {each.flow_run_id: each for each in tasks}
            progress: dict[Any, Any] = {}
            if stages:
                chosen = ArtifactFilterTaskRunId(any_=[each.id for each in stages.values()])
                found = client.read_artifacts(artifact_filter=ArtifactFilter(task_run_id=chosen))
                progress = {each.task_run_id: each.data for each in found if each.type == "progress"}
            for run in runs:
                stage = stages.get(run.id)
                share = progress.get(stage.id) if stage is not None else None
                rows.append(
                    {
                        "running": run.name,
                        "of": flow,
                        "stage": "" if stage is None else stage.name,
                        "progress": "" if share is None else f"{float(share):.0f}%",
                        "since": _time(run.start_time),
                    }
                )
    return rows


def failed_rows() -> list[dict[str, Any]]:
    """One row for each capture whose latest run did not succeed: when, and why, with the remedy."""
    from prefect.client.orchestration import get_client

    with get_client(sync_client=True) as client:
        latest: dict[str, Any] = {}
        for run in _runs(client, "capture", None):
            latest.setdefault(run.name, run)
    return [
        {"capture": name, "ended": _time(run.end_time), "why": _why(run)}
        for name, run in latest.items()
        if run.state is not None and run.state.is_final() and not run.state.is_completed()
    ]


def _runs(client: Any, flow: str, states: Iterable[Any] | None) -> list[Any]:
    """The newest runs of a flow, newest first."""
    from prefect.client.schemas.filters import (
        FlowFilter,
        FlowFilterName,
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
    )
    from prefect.client.schemas.sorting import FlowRunSort

    chosen = None
    if states is not None:
        chosen = FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=list(states))))
    found: list[Any] = client.read_flow_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=[flow])),
        flow_run_filter=chosen,
        sort=FlowRunSort.START_TIME_DESC,
        limit=LATEST,
    )
    return found


def _why(run: Any) -> str:
    """The error and its remedy, as the run's state has them."""
    message = (run.state.message or run.state.name).removeprefix(_PREFIX)
    kind, colon, rest = message.partition(": ")
    return rest if colon and kind.isidentifier() else message


def _time(moment: Any) -> str:
    return "" if moment is None else moment.astimezone().isoformat(sep=" ", timespec="seconds")
