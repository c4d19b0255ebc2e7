"""`glint status`: objects of the store, and what the dashboard knows of running and failed captures."""

import json
from typing import Any

from glint.flows.cli.options import Json, Store, chosen_store
from glint.flows.cli.output import echo


def status(store: Store = None, as_json: Json = False) -> None:
    """List the objects with their newest versions, what is running, and the captures that failed last."""
    from glint.flows.cli.tables import show, status_rows, table_of
    from glint.flows.errors import ServerError
    from glint.flows.runtime.prefect_server import Server, running_server, server_damage
    from glint.storage.locations.location import Location
    from glint.storage.locations.store_folder import check_store

    location = Location.parse(chosen_store(store))
    check_store(location)
    place = location.uri
    objects, damaged = status_rows(place)
    if not as_json:
        show(table_of(objects, f"no objects in the store {place}: `glint run CATALOGUE` adds objects"))
        for row in damaged:
            echo(f"{row['object']} cannot be read: {row['error']}", colour="red")
            echo(f"  -> {row['remedy']}")
    server: Server | None = None
    unreachable: ServerError | None = None
    try:
        server = running_server()
    except ServerError as error:
        # The store is read all the same.
        unreachable = error
    running, failed = list[dict[str, Any]](), list[dict[str, Any]]()
    if server is not None:
        from glint.flows.reporting.flow_runs import failed_rows, running_rows
        from glint.flows.runtime.orphaned_runs import mark_orphaned_crashed

        with server.reached():
            mark_orphaned_crashed()
            running, failed = running_rows(place), failed_rows(place)
    if as_json:
        for kind, rows in (("object", objects), ("damaged", damaged), ("running", running), ("failed", failed)):
            for row in rows:
                echo(json.dumps({"kind": kind, **row}, default=str))
    else:
        _print_runs(running, failed)
        if server is not None:
            echo(f"\ndashboard: {server.link()}")
        elif unreachable is None and (cause := server_damage()):
            echo(f"\nthe dashboard's database is damaged ({cause}); results are untouched", colour="yellow")
            echo("  -> the next `glint run` or `glint dashboard` moves it aside and starts a new one")
    if unreachable is not None:
        raise unreachable


def _print_runs(running: list[dict[str, Any]], failed: list[dict[str, Any]]) -> None:
    """Print the captures that are running as a table, and those that failed last with their reasons."""
    from glint.flows.cli.tables import show, table_of

    if running:
        echo()
        show(table_of(running, ""))
    for row in failed:
        echo()
        stage = f" in {row['stage']}" if row["stage"] else ""
        echo(f"{row['capture']} failed{stage} at {row['ended']}: {row['error']}", colour="red")
