"""Start and list scans of the inbox, which its deployment runs."""

from datetime import datetime
from typing import Any
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.filters import DeploymentFilter, DeploymentFilterId
from prefect.client.schemas.objects import WorkPoolStatus
from prefect.client.schemas.responses import DeploymentResponse
from prefect.client.schemas.sorting import FlowRunSort
from prefect.exceptions import ObjectNotFound

from glint.flows.errors import ServerError


def start_inbox_run(name: str) -> UUID:
    """Start a deployment's flow run without waiting for its end, and return its id.

    Raises:
        ServerError: the server has no such deployment.
    """
    with get_client(sync_client=True) as client:
        return client.create_flow_run_from_deployment(_deployment(client, name).id).id


def inbox_runs(name: str, limit: int) -> list[dict[str, Any]]:
    """Return one row for each flow run of a deployment, newest first: name, state, time, message.

    Raises:
        ServerError: the server has no such deployment.
    """
    with get_client(sync_client=True) as client:
        chosen = DeploymentFilter(id=DeploymentFilterId(any_=[_deployment(client, name).id]))
        runs = client.read_flow_runs(deployment_filter=chosen, sort=FlowRunSort.EXPECTED_START_TIME_DESC, limit=limit)
    return [
        {
            "scan": run.name,
            "state": "" if run.state is None else run.state.name,
            "time": _time(run.expected_start_time),
            "message": "" if run.state is None else run.state.message or "",
        }
        for run in runs
    ]


def unserved_pool(name: str) -> str | None:
    """Return the work pool of a deployment if no worker serves it, None if one does.

    Raises:
        ServerError: the server has no such deployment.
    """
    with get_client(sync_client=True) as client:
        pool = _deployment(client, name).work_pool_name
        served = pool is None or client.read_work_pool(pool).status is WorkPoolStatus.READY
        return None if served else pool


def _time(moment: datetime | None) -> str:
    return "" if moment is None else moment.astimezone().isoformat(timespec="seconds")


def _deployment(client: SyncPrefectClient, name: str) -> DeploymentResponse:
    try:
        return client.read_deployment_by_name(name)
    except ObjectNotFound:
        raise ServerError(f"the server has no deployment {name}", "glint deploy --inbox URI") from None
