"""`glint deploy`: a work pool, the deployments with their schedules and limits, and the notifications."""

from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import typer
from prefect import Flow
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.actions import WorkPoolCreate
from prefect.client.schemas.objects import ConcurrencyLimitConfig, ConcurrencyLimitStrategy, StateType
from prefect.deployments.runner import EntrypointType
from prefect.events.actions import ChangeFlowRunState, SendNotification
from prefect.events.schemas.automations import AutomationCore, EventTrigger, Posture
from prefect.events.schemas.events import ResourceSpecification
from prefect.exceptions import ObjectNotFound
from prefect.schedules import Cron

from glint.flows.deployments.maintenance import DISK_EVENT, run_maintenance, size_of
from glint.flows.deployments.scheduled import evaluate_reference, run_apart, run_one, watch_inbox
from glint.flows.errors import ServerError
from glint.flows.pipeline.drift import DRIFT_EVENT
from glint.flows.runtime.prefect_server import start_server
from glint.storage.errors import InputError
from glint.storage.locations.location import Location

TAG = "glint"
HEARTBEAT = 30
"""Seconds between two signs of life of a flow run; after three missed ones it is crashed."""

ENDS = ("Completed", "Failed", "PartiallyCompleted", "Cancelled", "Crashed", "Paused")
"""States after which a flow run gives no sign of life."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What to deploy. inbox, reference: None leaves that deployment out; pool, kind: name and type of the work pool
    (process, docker, kubernetes); notify: TYPE/NAME of a notification block; objects: how many run at once."""

    store: str
    inbox: str | None = None
    reference: str | None = None
    scheduler: str | None = None
    pool: str = "glint"
    kind: str = "process"
    image: str | None = None
    timezone: str = "UTC"
    nightly: str = "0 2 * * *"
    weekly: str = "0 5 * * 0"
    frames_budget: str | None = None
    objects: int = 4
    drift: float = 0.5
    notify: str | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """A deployment: limit and whether what comes beyond it waits or is cancelled."""

    flow: Flow[..., Any]
    name: str
    parameters: dict[str, Any]
    cron: str | None = None
    limit: int = 1
    waits: bool = True
    description: str = ""


def entries(wishes: Wishes) -> list[Entry]:
    """The deployments of these wishes.

    Raises:
        InputError: the budget is no size; LocationError: an address cannot be understood.
    """
    # A worker runs in a folder of its own: no address may be relative.
    store = Location.parse(wishes.store).uri
    shared = {"store": store, "scheduler": wishes.scheduler}
    try:
        budget = None if wishes.frames_budget is None else size_of(wishes.frames_budget)
    except ValueError as error:
        raise InputError(f"--frames-budget: {error}", "write it as 500MB, 20GB or 1.5TB") from None
    found = [
        Entry(
            run_maintenance,
            "weekly",
            {"store": store, "frames_budget": budget},
            wishes.weekly,
            description="Garbage collection and the budget of the cache of frames.",
        ),
        Entry(
            run_one,
            "on-demand",
            {**shared, "drift": wishes.drift},
            limit=wishes.objects,
            description="One object: give catalogue and object_id.",
        ),
        Entry(
            run_apart,
            "on-demand",
            {**shared, "drift": wishes.drift},
            description="Every object of a catalogue as a flow run of its own: give catalogue.",
        ),
    ]
    if wishes.inbox is not None:
        # A scan that finds its predecessor still at work has nothing to add.
        parameters = {**shared, "inbox": Location.parse(wishes.inbox).uri, "drift": wishes.drift}
        found.append(
            Entry(
                watch_inbox,
                "nightly",
                parameters,
                wishes.nightly,
                waits=False,
                description="New and changed captures of the inbox.",
            )
        )
    if wishes.reference is not None:
        parameters = {**shared, "catalogue": Location.parse(wishes.reference).uri, "drift": wishes.drift}
        found.append(
            Entry(
                evaluate_reference,
                "weekly",
                parameters,
                wishes.weekly,
                description="The reference captures, judged against their truth.",
            )
        )
    return found


def deploy_and_tell(wishes: Wishes) -> None:
    """Deploy, and say what to start; also on the embedded server."""
    server = start_server()
    with server.connected():
        names = deploy(wishes)
    for name in names:
        typer.echo(name)
    typer.echo(f"dashboard {server.ui_url}/deployments")
    typer.echo(f"next: PREFECT_API_URL={server.api_url} prefect worker start --pool {wishes.pool}")


def deploy(wishes: Wishes) -> list[str]:
    """Put it all on the server of this process; names of the deployments. Repeating it changes what is there.

    Raises:
        InputError: the time zone, a schedule, the pool's type or the notification block is unknown.
        ServerError: the server does not take it.
    """
    with get_client(sync_client=True) as client:
        block = None if wishes.notify is None else _block(client, wishes.notify)
        _make_pool(client, wishes.pool, wishes.kind)
        names = [_apply(each, wishes) for each in entries(wishes)]
        for automation in [_heartbeats(), *([] if block is None else _notifications(block))]:
            for old in client.read_automations_by_name(automation.name):
                client.delete_automation(old.id)
            client.create_automation(automation)
    return names


def _apply(entry: Entry, wishes: Wishes) -> str:
    strategy = ConcurrencyLimitStrategy.ENQUEUE if entry.waits else ConcurrencyLimitStrategy.CANCEL_NEW
    environment = {"PREFECT_FLOWS_HEARTBEAT_FREQUENCY": str(HEARTBEAT)}
    try:
        schedule = None if entry.cron is None else Cron(entry.cron, timezone=wishes.timezone)
        made: Any = entry.flow.to_deployment(
            entry.name,
            schedule=schedule,
            concurrency_limit=ConcurrencyLimitConfig(limit=entry.limit, collision_strategy=strategy),
            parameters=entry.parameters,
            description=entry.description,
            tags=[TAG],
            job_variables={"env": environment, **({"image": wishes.image} if wishes.image else {})},
            enforce_parameter_schema=False,
            entrypoint_type=EntrypointType.MODULE_PATH,
        )
    except ValueError as error:
        raise InputError(
            f"no schedule {entry.cron!r} in {wishes.timezone} ({str(error).splitlines()[0]})",
            "give five fields of cron and a zone such as Europe/Berlin",
        ) from None
    made.apply(work_pool_name=wishes.pool)
    return f"{entry.flow.name}/{entry.name}"


def _make_pool(client: SyncPrefectClient, name: str, kind: str) -> None:
    try:
        there = client.read_work_pool(name)
    except ObjectNotFound:
        pass
    else:
        if there.type != kind:
            raise ServerError(f"the work pool {name} has the type {there.type}", "name another --pool, or that --type")
        return
    known = {worker: facts for each in client.read_worker_metadata().values() for worker, facts in each.items()}
    if kind not in known:
        raise InputError(f"no type of work pool {kind!r}", f"there are {', '.join(sorted(known))}")
    template = known[kind]["default_base_job_configuration"]
    client.create_work_pool(WorkPoolCreate(name=name, type=kind, base_job_template=template))


def _heartbeats() -> AutomationCore:
    """A flow run that gave signs of life and gives none any more has died with its machine."""
    return AutomationCore(
        name="glint: dead flow runs",
        description="Marks flow runs as crashed whose process or machine is gone.",
        trigger=EventTrigger(
            posture=Posture.Proactive,
            after={"prefect.flow-run.heartbeat"},
            expect={
                "prefect.flow-run.heartbeat",
                *(f"prefect.flow-run.{end}" for end in ENDS),
            },
            match=ResourceSpecification({"prefect.resource.id": "prefect.flow-run.*"}),
            for_each={"prefect.resource.id"},
            threshold=1,
            within=timedelta(seconds=3 * HEARTBEAT),
        ),
        actions=[
            ChangeFlowRunState(
                state=StateType.CRASHED,
                name="Crashed",
                message="Its process gave no sign of life: run again.",
                force=False,
            )
        ],
    )


def _notifications(block: Any) -> list[AutomationCore]:
    """Word of failed runs, of surfaces that moved, and of a disk that fills."""

    def told(name: str, subject: str, body: str, **of: Any) -> AutomationCore:
        action = SendNotification(block_document_id=block, subject=subject, body=body)
        trigger = EventTrigger(posture=Posture.Reactive, threshold=1, within=timedelta(0), **of)
        return AutomationCore(name=f"glint: {name}", trigger=trigger, actions=[action])

    run = "{{ flow_run|ui_url }}"
    return [
        told(
            "failure",
            "Glint: {{ flow.name }} {{ flow_run.state.name }}",
            "{{ flow_run.name }}: {{ flow_run.state.message }}\n" + run,
            expect={"prefect.flow-run.Failed", "prefect.flow-run.PartiallyCompleted", "prefect.flow-run.Crashed"},
            match_related=[
                ResourceSpecification(
                    {"prefect.resource.id": "prefect.deployment.*", "prefect.resource.role": "deployment"}
                ),
                ResourceSpecification({"prefect.resource.id": f"prefect.tag.{TAG}", "prefect.resource.role": "tag"}),
            ],
        ),
        told(
            "drift",
            "Glint: a surface has moved",
            "{{ event.payload.object }}/{{ event.payload.capture }} moved by {{ event.payload.degrees }} degrees"
            " from {{ event.payload.before }} to {{ event.payload.after }}",
            expect={DRIFT_EVENT},
        ),
        told("disk", "Glint: the disk is filling", "{{ event.payload.warning }}", expect={DISK_EVENT}),
    ]


def _block(client: SyncPrefectClient, name: str) -> Any:
    kind, _, title = name.partition("/")
    try:
        return client.read_block_document_by_name(title, kind).id
    except ObjectNotFound:
        raise InputError(
            f"the server has no notification block {name}", "make it on the dashboard, and name it TYPE/NAME"
        ) from None
