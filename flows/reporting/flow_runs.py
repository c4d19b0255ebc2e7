"""Ask the Prefect server which captures of a store are running, and which failed last."""

from typing import Any

MAX_RUNS = 200
"""Number of flow runs or captures that are read from the server, the newest ones."""

MAX_PAGES = 5
"""Pages of MAX_RUNS runs in which those of the store are looked for: a server may serve many stores."""

EXCEPTION_PREFIX = "Task run encountered an exception "
"""Beginning of Prefect's message of a failed task run."""


def running_rows(store: str) -> list[dict[str, Any]]:
    """Return one row for each running catalogue, maintenance and capture of a store: type, stage, progress, begin."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterTaskRunId
    from prefect.client.schemas.objects import StateType

    states, progress, stages = [StateType.RUNNING], dict[Any, Any](), dict[Any, Any]()
    with get_client(sync_client=True) as client:
        rows = [
            {"running": run.name, "type": flow, "stage": "", "progress": "", "since": _time(run.start_time)}
            for flow in ("catalogue", "maintenance")
            for run in _flow_runs(client, flow, states)
            if run.parameters.get("store") == store
        ]
        captures = _capture_runs(client, states, store)
        if captures:
            chosen = ArtifactFilterTaskRunId(any_=[run.id for run in captures])
            artifacts = client.read_artifacts(artifact_filter=ArtifactFilter(task_run_id=chosen))
            progress = {artifact.task_run_id: artifact for artifact in artifacts if artifact.type == "progress"}
            stages = _stage_names(client, captures, states)
    for run in captures:
        artifact, stage = progress.get(run.id), stages.get(run.id)
        shown = "" if artifact is None else str(artifact.description).partition(", ")[0]  # the time left follows
        rows.append(
            {
                "running": run.name,
                "type": "capture",
                "stage": stage or shown,
                "progress": "" if artifact is None else f"{float(artifact.data):.0f}%",
                "since": _time(run.start_time),
            }
        )
    return rows


def failed_rows(store: str) -> list[dict[str, Any]]:
    """Return one row for each capture of a store whose last run did not succeed: end, stage, error with its remedy."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.objects import StateType

    with get_client(sync_client=True) as client:
        latest: dict[str, Any] = {}
        for run in _capture_runs(client, None, store):
            latest.setdefault(run.name, run)
        failed = [run for run in latest.values() if run.state and run.state.is_final() and not run.state.is_completed()]
        stages = _stage_names(client, failed, [StateType.FAILED, StateType.CRASHED])
    return [
        {"capture": run.name, "ended": _time(run.end_time), "stage": stages.get(run.id, ""), "error": _error(run)}
        for run in failed
    ]


def _flow_runs(client: Any, flow: str, states: list[Any]) -> list[Any]:
    """Read the flow runs in these states, newest first."""
    from prefect.client.schemas.filters import (
        FlowFilter,
        FlowFilterName,
        FlowRunFilter,
        FlowRunFilterState,
        FlowRunFilterStateType,
    )
    from prefect.client.schemas.sorting import FlowRunSort

    runs: list[Any] = client.read_flow_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=[flow])),
        flow_run_filter=FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=states))),
        sort=FlowRunSort.START_TIME_DESC,
        limit=MAX_RUNS,
    )
    return runs


def _capture_runs(client: Any, states: list[Any] | None, store: str) -> list[Any]:
    """Read task runs of a store's captures and models (named OBJECT/..) in these states (None: any), newest first."""
    runs: list[Any] = []
    for page in range(MAX_PAGES):
        page_runs = _task_runs(client, states, page * MAX_RUNS)
        own = _flow_runs_of(client, [run.flow_run_id for run in page_runs], store)
        runs += [run for run in page_runs if run.flow_run_id in own]
        if len(page_runs) < MAX_RUNS or len(runs) >= MAX_RUNS:
            break
    return runs[:MAX_RUNS]


def _flow_runs_of(client: Any, ids: list[Any], store: str) -> set[Any]:
    """Return those of the ids whose flow runs work on a store."""
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId

    if not ids:
        return set()
    chosen = FlowRunFilter(id=FlowRunFilterId(any_=list(set(ids))))
    runs = client.read_flow_runs(flow_run_filter=chosen, limit=MAX_RUNS)
    return {run.id for run in runs if run.parameters.get("store") == store}


def _task_runs(client: Any, states: list[Any] | None, offset: int) -> list[Any]:
    """Read a page of the task runs of all stores."""
    from prefect.client.schemas.filters import (
        FlowFilter,
        FlowFilterName,
        TaskRunFilter,
        TaskRunFilterName,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )
    from prefect.client.schemas.sorting import TaskRunSort

    runs: list[Any] = client.read_task_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=["object"])),
        task_run_filter=TaskRunFilter(
            name=TaskRunFilterName(like_="/"),
            state=None if states is None else TaskRunFilterState(type=TaskRunFilterStateType(any_=states)),
        ),
        sort=TaskRunSort.EXPECTED_START_TIME_DESC,
        limit=MAX_RUNS,
        offset=offset,
    )
    return runs


def _stage_names(client: Any, captures: list[Any], states: list[Any]) -> dict[Any, str]:
    """Return the names of the latest stages in these states, by the ids of the runs of these captures."""
    from prefect.client.schemas.filters import (
        FlowRunFilter,
        FlowRunFilterId,
        TaskRunFilter,
        TaskRunFilterState,
        TaskRunFilterStateType,
    )
    from prefect.client.schemas.sorting import TaskRunSort

    if not captures:
        return {}
    runs = client.read_task_runs(
        flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=list({run.flow_run_id for run in captures}))),
        task_run_filter=TaskRunFilter(state=TaskRunFilterState(type=TaskRunFilterStateType(any_=states))),
        sort=TaskRunSort.EXPECTED_START_TIME_DESC,
        limit=MAX_RUNS,
    )
    names: dict[Any, str] = {}
    for run in runs:
        for parent in run.task_inputs.get("__parents__", []):
            names.setdefault(parent.id, run.name)
    return names


def _error(run: Any) -> str:
    """Return the error and its remedy from the message of the run's state."""
    message = (run.state.message or run.state.name).removeprefix(EXCEPTION_PREFIX)
    kind, colon, rest = message.partition(": ")
    return rest if colon and kind.isidentifier() else message


def _time(moment: Any) -> str:
    return "" if moment is None else moment.astimezone().isoformat(timespec="seconds")
