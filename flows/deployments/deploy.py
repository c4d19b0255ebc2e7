"""Put Glint's deployments on a Prefect server: the work pool, schedules, concurrency limits and automations."""

from dataclasses import dataclass
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from prefect import Flow
from prefect.client.orchestration import SyncPrefectClient, get_client
from prefect.client.schemas.actions import WorkPoolCreate
from prefect.client.schemas.objects import ConcurrencyLimitConfig, ConcurrencyLimitStrategy
from prefect.client.schemas.schedules import CronSchedule
from prefect.deployments.runner import EntrypointType
from prefect.exceptions import ObjectNotFound
from prefect.schedules import Cron

from glint.flows.deployments.automations import (
    HEARTBEAT_SECONDS,
    TAG,
    heartbeat_automation,
    notification_automations,
)
from glint.flows.deployments.maintenance import run_maintenance
from glint.flows.deployments.on_demand import ON_DEMAND, run_objects_separately, run_one_object
from glint.flows.deployments.scheduled import evaluate_reference, scan_inbox
from glint.flows.errors import ServerError
from glint.storage.errors import InputError
from glint.storage.locations.location import Location


@dataclass(frozen=True, slots=True)
class DeploymentOptions:
    """Options of `glint deploy`.

    inbox, reference: None leaves that deployment out; inbox_may_read: folders that catalogues in the inbox may name;
    pool, pool_type: name and type of the work pool (process, docker, kubernetes); frames_budget: bytes; objects:
    on-demand objects that run at once; drift: degrees; notify: TYPE/NAME of a notification block.
    """

    store: str
    inbox: str | None = None
    reference: str | None = None
    scheduler: str | None = None
    pool: str = "glint"
    pool_type: str = "process"
    image: str | None = None
    timezone: str = "UTC"
    nightly: str = "0 2 * * *"
    weekly: str = "0 5 * * 0"
    frames_budget: int | None = None
    objects: int = 4
    drift: float = 0.5
    notify: str | None = None
    inbox_may_read: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DeploymentSpec:
    """A deployment to create; `limit`: flow runs at once; a run beyond it waits (`queues`) or is cancelled."""

    flow: Flow[..., Any]
    name: str
    parameters: dict[str, Any]
    description: str
    cron: str | None = None
    limit: int = 1
    queues: bool = True


def deployment_specs(options: DeploymentOptions) -> list[DeploymentSpec]:
    """List the deployments that these options ask for.

    Raises:
        LocationError: an address cannot be understood.
    """
    # A worker runs in a folder of its own: no address may be relative.
    store = Location.parse(options.store).uri
    shared = {"store": store, "scheduler": options.scheduler, "drift": options.drift}
    specs = [
        DeploymentSpec(
            run_maintenance,
            "weekly",
            {"store": store, "frames_budget": options.frames_budget, "verify": True},
            "Collects garbage, keeps the cache of frames within its budget, and verifies all versions.",
            options.weekly,
        ),
        DeploymentSpec(
            run_one_object,
            ON_DEMAND,
            shared,
            "Runs one object; needs the parameters catalogue and object_id.",
            limit=options.objects,
        ),
        DeploymentSpec(
            run_objects_separately,
            ON_DEMAND,
            shared,
            "Runs each object of a catalogue as a flow run of its own; needs the parameter catalogue.",
        ),
    ]
    if options.inbox is not None:
        specs.append(
            DeploymentSpec(
                scan_inbox,
                "nightly",
                {
                    **shared,
                    "inbox": Location.parse(options.inbox).uri,
                    "allowed_folders": [Location.parse(folder).uri for folder in options.inbox_may_read],
                },
                "Runs new and changed captures of the inbox.",
                options.nightly,
                # A scan that starts while the previous one is still running has nothing to add.
                queues=False,
            )
        )
    if options.reference is not None:
        specs.append(
            DeploymentSpec(
                evaluate_reference,
                "weekly",
                {**shared, "catalogue": Location.parse(options.reference).uri},
                "Runs the reference captures and evaluates them against their ground truth.",
                options.weekly,
            )
        )
    return specs


def deploy(options: DeploymentOptions) -> list[str]:
    """Create or update everything on the server that this process is connected to; return the deployments' names.

    Raises:
        InputError: the time zone, a schedule, the pool's type or the notification block is unknown.
        ServerError: the work pool exists with another type.
    """
    check_schedules(options)
    with get_client(sync_client=True) as client:
        block = None if options.notify is None else _notification_block(client, options.notify)
        _create_pool(client, options.pool, options.pool_type)
        names = [_apply(spec, options) for spec in deployment_specs(options)]
        for automation in [heartbeat_automation(), *([] if block is None else notification_automations(block))]:
            for previous in client.read_automations_by_name(automation.name):
                client.delete_automation(previous.id)
            client.create_automation(automation)
    return names


def check_schedules(options: DeploymentOptions) -> None:
    """Check the time zone and the schedules, also those of deployments that are left out.

    Raises:
        InputError: one is unknown.
    """
    try:
        ZoneInfo(options.timezone)
    except (ValueError, OSError, ZoneInfoNotFoundError):
        message = f"--timezone {options.timezone!r} is not a time zone"
        raise InputError(message, "give one of the tz database, such as Europe/Berlin") from None
    for option, cron in (("--nightly", options.nightly), ("--weekly", options.weekly)):
        try:
            CronSchedule(cron=cron, timezone=options.timezone)
        except ValueError:
            message = f"{option} {cron!r} is not a schedule"
            raise InputError(message, "give five fields of cron, such as '0 2 * * *'") from None


def _apply(spec: DeploymentSpec, options: DeploymentOptions) -> str:
    strategy = ConcurrencyLimitStrategy.ENQUEUE if spec.queues else ConcurrencyLimitStrategy.CANCEL_NEW
    environment = {"PREFECT_FLOWS_HEARTBEAT_FREQUENCY": str(HEARTBEAT_SECONDS)}
    schedule = None if spec.cron is None else Cron(spec.cron, timezone=options.timezone)
    deployment: Any = spec.flow.to_deployment(
        spec.name,
        schedule=schedule,
        concurrency_limit=ConcurrencyLimitConfig(limit=spec.limit, collision_strategy=strategy),
        parameters=spec.parameters,
        description=spec.description,
        tags=[TAG],
        job_variables={"env": environment, **({"image": options.image} if options.image else {})},
        enforce_parameter_schema=False,
        entrypoint_type=EntrypointType.MODULE_PATH,
    )
    deployment.apply(work_pool_name=options.pool)
    return f"{spec.flow.name}/{spec.name}"


def _create_pool(client: SyncPrefectClient, name: str, pool_type: str) -> None:
    """Create the work pool unless it exists."""
    try:
        pool = client.read_work_pool(name)
    except ObjectNotFound:
        pass
    else:
        if pool.type != pool_type:
            raise ServerError(
                f"the work pool {name} has the type {pool.type}, not {pool_type}",
                f"name another --pool, or --type {pool.type}",
            )
        return
    types = {key: about for group in client.read_worker_metadata().values() for key, about in group.items()}
    if pool_type not in types:
        raise InputError(f"{pool_type!r} is not a type of work pool", f"choose one of {', '.join(sorted(types))}")
    template = types[pool_type]["default_base_job_configuration"]
    client.create_work_pool(WorkPoolCreate(name=name, type=pool_type, base_job_template=template))


def _notification_block(client: SyncPrefectClient, name: str) -> Any:
    """Return the document id of the block TYPE/NAME."""
    block_type, _, title = name.partition("/")
    try:
        return client.read_block_document_by_name(title, block_type).id
    except ObjectNotFound:
        raise InputError(
            f"the server has no notification block {name}", "create it on the dashboard, and name it as TYPE/NAME"
        ) from None
