"""`glint maintain`: the maintenance flow, run now."""

import json
from dataclasses import asdict

import typer

from glint.flows.runtime.prefect_server import start_server
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.storage.locations.probe import probe


def maintain_store(
    store: str, dry_run: bool, keep: int | None, older_than: float, frames_budget: str | None, as_json: bool
) -> int:
    """Maintain a store; the command's exit status."""
    place = Location.parse(store)
    probe(place)
    server = start_server()
    from glint.flows.cli.tables import show, table_of
    from glint.flows.deployments.maintenance import REMEDY, Maintenance, rows_of, run_maintenance, size_of
    from glint.flows.results import result_of
    from glint.flows.runtime.orphaned_runs import mark_orphaned_crashed, tagged_with_process

    try:
        budget = None if frames_budget is None else size_of(frames_budget)
    except ValueError as error:
        raise InputError(f"--frames-budget: {error}", "write it as 500MB, 20GB or 1.5TB") from None
    with server.connected(), tagged_with_process():
        mark_orphaned_crashed()
        done: Maintenance = result_of(run_maintenance(place.uri, dry_run, keep, older_than, budget, return_state=True))
    failed = any(each.failed for each in done.cleanings)
    if as_json:
        typer.echo(json.dumps({"kind": "maintenance", **asdict(done)}))
        return int(failed)
    show(table_of(rows_of(done), "nothing to do"))
    typer.echo(f"{'would free at least' if dry_run else 'freed'} {done.bytes / 1e6:.1f} MB")
    if done.warning:
        typer.secho(done.warning, fg="yellow")
        typer.echo(f"  -> {REMEDY}")
    return int(failed)
