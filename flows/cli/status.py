"""`glint status`: what the dashboard shows, on a terminal: objects, what runs and how far it is, what failed, why."""

import json
from typing import Any

import typer

from glint.flows.cli.tables import show, status_rows, table_of
from glint.flows.runtime.prefect_server import running_server

LATEST = 200
"""Captures that are looked at, the newest ones."""

_PREFIX = "Task run encountered an exception "


def tell_status(store: str, as_json: bool) -> None:
    """Print objects of the store, and of the server, if one is up, what runs and which captures failed last."""
    objects = status_rows(store)
    server = running_server()
    running, failed = list[dict[str, Any]](), list[dict[str, Any]]()
    if server is not None:
        from glint.flows.runtime.orphaned_runs import mark_orphaned_crashed

        with server.reached():
            mark_orphaned_crashed()
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
    from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterTaskRunId
    from prefect.client.schemas.objects import StateType

    running = [StateType.RUNNING]
    with get_client(sync_client=True) as client:
        rows = [
            {"running": run.name, "of": flow, "stage": "", "progress": "", "since": _time(run.start_time)}
            for flow in ("catalogue", "maintenance")
            for run in _flow_runs(client, flow, running)
        ]
        captures, bars = _capture_runs(client, running), dict[Any, Any]()
        if captures:
            chosen = ArtifactFilterTaskRunId(any_=[each.id for each in captures])
            found = client.read_artifacts(artifact_filter=ArtifactFilter(task_run_id=chosen))
            bars = {each.task_run_id: each for each in found if each.type == "progress"}
    for run in captures:
        bar = bars.get(run.id)
        rows.append(
            {
                "running": run.name,
                "of": "capture",
                "stage": "" if bar is None else bar.description,
                "progress": "" if bar is None else f"{float(bar.data):.0f}%",
                "since": _time(run.start_time),
            }
        )
    return rows


def failed_rows() -> list[dict[str, Any]]:
    """One row for each capture that did not succeed when it was tried last: when, and why, with the remedy."""
    from prefect.client.orchestration import get_client

    with get_client(sync_client=True) as client:
        latest: dict[str, Any] = {}
        for run in _capture_runs(client, None):
            latest.setdefault(run.name, run)
    return [
        {"capture": name, "ended": _time(run.end_time), "why": _why(run)}
        for name, run in latest.items()
        if run.state is not None and run.state.is_final() and not run.state.is_completed()
    ]


def _flow_runs(client: Any, flow: str, states: list[Any]) -> list[Any]:
    """Flow runs in these states, newest first."""
    from prefect.client.schemas.filters import (
        FlowFilter,
        FlowFilterName,
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
    )
    from prefect.client.schemas.sorting import FlowRunSort

    found: list[Any] = client.read_flow_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=[flow])),
        flow_run_filter=FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=states))),
        sort=FlowRunSort.START_TIME_DESC,
        limit=LATEST,
    )
    return found


def _capture_runs(client: Any, states: list[Any] | None) -> list[Any]:
    """Task runs of captures and models (all that are named OBJECT/..) in these states (None: any), newest first."""
    from prefect.client.schemas.filters import (
        FlowFilter,
        FlowFilterName,
        TaskRunFilter,
        TaskRunFilterName,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )
    from prefect.client.schemas.sorting import TaskRunSort

    found: list[Any] = client.read_task_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=["object"])),
        task_run_filter=TaskRunFilter(
            name=TaskRunFilterName(like_="/"),
            state=None if states is None else TaskRunFilterState(type=TaskRunFilterStateType(any_=states)),
        ),
        sort=TaskRunSort.EXPECTED_START_TIME_DESC,
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
