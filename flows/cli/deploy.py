"""`glint deploy`: put deployments and their schedules on the Prefect server."""

from shlex import quote
from typing import Annotated

import typer

from glint.flows.cli.options import DRIFT_HELP, FramesBudget, Scheduler, Store, budget_bytes, chosen_store
from glint.flows.cli.output import echo


def deploy(
    store: Store = None,
    inbox: Annotated[
        str | None,
        typer.Option(metavar="URI", help="Folder or prefix whose sub-folders are scanned for captures every night."),
    ] = None,
    inbox_may_read: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FOLDER", help="Folder that catalogues in the inbox may name besides their own; repeatable."
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(metavar="CATALOGUE", help="Catalogue of captures with ground truth, evaluated every week."),
    ] = None,
    scheduler: Scheduler = None,
    pool: Annotated[str, typer.Option(help="Name of the work pool; created if it does not exist.")] = "glint",
    pool_type: Annotated[
        str, typer.Option("--type", help="Type of the work pool: process, docker, kubernetes, ..")
    ] = "process",
    image: Annotated[
        str | None, typer.Option(help="Container image that docker and kubernetes work pools start.")
    ] = None,
    timezone: Annotated[str, typer.Option(help="Time zone of the schedules, such as Europe/Berlin.")] = "UTC",
    nightly: Annotated[str, typer.Option(metavar="CRON", help="Schedule of the inbox scan.")] = "0 2 * * *",
    weekly: Annotated[
        str, typer.Option(metavar="CRON", help="Schedule of the reference captures and of maintenance.")
    ] = "0 5 * * 0",
    objects: Annotated[
        int, typer.Option(metavar="N", min=1, help="Number of on-demand objects that run at the same time.")
    ] = 4,
    drift: Annotated[float, typer.Option(metavar="DEGREES", min=0.0, help=DRIFT_HELP)] = 0.5,
    frames_budget: FramesBudget = None,
    notify: Annotated[
        str | None,
        typer.Option(metavar="TYPE/NAME", help="Notification block that receives failures, drift and disk warnings."),
    ] = None,
) -> None:
    """Deploy to the Prefect server: inbox nightly, reference and maintenance weekly, objects on demand."""
    from glint.storage.inbox import check_folder
    from glint.storage.locations.location import Location
    from glint.tasks.engine.references import check_truth

    budget = budget_bytes(frames_budget)
    if pool_type == "process":
        # Containers of other pools may have files that this machine does not have.
        if inbox is not None:
            check_folder(Location.parse(inbox))
        for folder in inbox_may_read or ():
            check_folder(Location.parse(folder), "--inbox-may-read")
        if reference is not None:
            check_truth(reference)
    from glint.flows.runtime.prefect_server import start_server

    server = start_server()
    from glint.flows.deployments.deploy import DeploymentOptions
    from glint.flows.deployments.deploy import deploy as create_deployments

    options = DeploymentOptions(
        store=chosen_store(store),
        inbox=inbox,
        inbox_may_read=tuple(inbox_may_read or ()),
        reference=reference,
        scheduler=scheduler,
        pool=pool,
        pool_type=pool_type,
        image=image,
        timezone=timezone,
        nightly=nightly,
        weekly=weekly,
        frames_budget=budget,
        objects=objects,
        drift=drift,
        notify=notify,
    )
    with server.connected():
        names = create_deployments(options)
    for name in names:
        echo(name)
    echo(f"dashboard: {server.link('deployments')}")
    echo(f"next: glint worker --pool {quote(pool)}")
    if inbox is not None:
        echo("then, to scan the inbox before its schedule: glint inbox --now")
