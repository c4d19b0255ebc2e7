"""`glint status`: objects of the store, and what the dashboard knows of running and failed captures."""

import json
from typing import Any

from glint.flows.cli.options import Json, Store, chosen_store
from glint.flows.cli.output import echo


def status(store: Store = None, as_json: Json = False) -> None:
    """List the objects with their newest versions, what is running, and the captures that failed last."""
    from glint.flows.cli.tables import show, status_rows, table_of
    from glint.flows.runtime.prefect_server import running_server, server_damage
    from glint.storage.locations.location import Location
    from glint.storage.locations.store_folder import check_store

    location = Location.parse(chosen_store(store))
    check_store(location)
    place = location.uri
    objects, damaged = status_rows(place)
    server = running_server()
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
        return
    show(table_of(objects, f"no objects in the store {place}: `glint run CATALOGUE` adds objects"))
    for row in damaged:
        echo(f"{row['object']} cannot be read: {row['error']}", colour="red")
        echo(f"  -> {row['remedy']}")
    if running:
        echo()
        show(table_of(running, ""))
    for row in failed:
        echo()
        stage = f" in {row['stage']}" if row["stage"] else ""
        echo(f"{row['capture']} failed{stage} at {row['ended']}: {row['error']}", colour="red")
    if server is None and (cause := server_damage()):
        echo(f"\nthe dashboard's database is damaged ({cause}); results are untouched", colour="yellow")
        echo("  -> the next `glint run` or `glint dashboard` moves it aside and starts a new one")
    if server is not None:
        echo(f"\ndashboard: {server.link()}")
