"""`glint maintain`: run the maintenance flow."""

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from glint.flows.cli.options import FramesBudget, Json, Store, budget_bytes, chosen_store, json_line, print_lines
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.storage.maintenance.maintain import Maintenance


def maintain(
    store: Store = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Remove nothing, and print what would be removed.")
    ] = False,
    keep: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Keep the newest N versions of each object (default: all).")
    ] = None,
    older_than: Annotated[
        float,
        typer.Option(
            metavar="DAYS", min=0.0, help="Only remove data unused for DAYS; in object stores at least an hour."
        ),
    ] = 1.0,
    frames_budget: FramesBudget = None,
    as_json: Json = False,
) -> None:
    """Remove data that no version needs, limit the cache of frames, and warn before the disk is full."""
    from glint.flows.runtime.prefect_server import start_server
    from glint.storage.locations.conditional_writes import check_conditional_writes
    from glint.storage.locations.location import Location
    from glint.storage.locations.store_folder import check_store

    budget = budget_bytes(frames_budget)
    place = Location.parse(chosen_store(store))
    check_store(place)
    if not dry_run:
        check_conditional_writes(place)
    server = start_server()
    from glint.flows.deployments.maintenance import run_maintenance
    from glint.flows.results import result_of
    from glint.flows.runtime.orphaned_runs import mark_orphaned_crashed, tagged_with_process

    with server.connected(), tagged_with_process():
        mark_orphaned_crashed()
        done: Maintenance = result_of(run_maintenance(place.uri, dry_run, keep, older_than, budget, return_state=True))
    if as_json:
        print_lines([json_line("maintenance", done)])
    else:
        _print_maintenance(done)
    sys.exit(1 if done.failed else 0)


def _print_maintenance(done: "Maintenance") -> None:
    from glint.flows.cli.tables import show, table_of
    from glint.storage.maintenance.disk_space import DISK_SPACE_REMEDY

    show(table_of(done.rows(), "nothing to do"))
    echo(done.summary)
    if done.warning:
        echo(done.warning, colour="yellow")
        echo(f"  -> {DISK_SPACE_REMEDY}")
