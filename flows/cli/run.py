"""`glint run`: process a catalogue, with progress and a table of results."""

import json
import sys
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from glint.flows.cli.options import (
    DRIFT_HELP,
    CatalogueFile,
    Json,
    Only,
    Scheduler,
    Store,
    chosen_store,
    store_option,
)
from glint.flows.cli.output import echo
from glint.flows.reporting.review_links import review_address

if TYPE_CHECKING:
    from glint.flows.pipeline.run import Summary


def run(
    file: CatalogueFile,
    store: Store = None,
    only: Only = None,
    scheduler: Scheduler = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Worker processes of the local cluster (default: one per processor).")
    ] = None,
    rehash: Annotated[
        bool,
        typer.Option("--rehash", help="Read all input files again, even if their modification times are unchanged."),
    ] = False,
    drift: Annotated[float | None, typer.Option(metavar="DEGREES", min=0.0, help=DRIFT_HELP)] = None,
    adopt: Annotated[
        bool, typer.Option("--adopt", help="Continue objects that another catalogue has published from other videos.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Process a catalogue: compute each capture's surface, publish a version of each object.

    What is up to date is skipped, and an interrupted run continues where it stopped.
    """
    from glint.flows.pipeline.run import run as run_all
    from glint.flows.reporting.console import open_console

    address = chosen_store(store)
    with open_console(as_json) as console:
        summary = run_all(
            file,
            address,
            console,
            only=only or [],
            scheduler=scheduler,
            workers=workers,
            rehash=rehash,
            drift=drift,
            adopt=adopt,
        )
    if as_json:
        from glint.flows.cli.tables import summary_json

        echo(json.dumps(summary_json(summary)))
    else:
        _print_summary(summary, file, store)
    sys.exit(1 if summary.result.failed else 0)


def _print_summary(summary: "Summary", file: str, store: str | None) -> None:
    """Print the table of captures, errors and warnings with their remedies, and the next command."""
    from glint.flows.cli.tables import run_table, show

    show(run_table(summary))
    for capture in summary.result.failed:
        echo(f"{capture.name} failed: {capture.error}", colour="red")
        echo(f"  -> {capture.remedy}")
    for drift in summary.result.drifts:
        echo(f"{drift}", colour="yellow")
        echo(f"  -> glint diff {drift.object_id} {drift.before} {drift.after}{store_option(store)}")
    echo(f"dashboard: {summary.page}")
    echo(f"review: glint review {quote(file)}{store_option(store)}, then {review_address()}")
    published = next((item.object_id for item in summary.result.objects if item.version is not None), None)
    if published is not None:
        # The folder of the object's own name may be the one with its videos.
        echo(f"next: glint export {published} --out {published}-export{store_option(store)}")
