"""`glint worker`, `glint inbox`, `glint prefect`: serve, start and steer what `glint deploy` has put on the server."""

import sys
from shlex import quote
from typing import Annotated

import typer

from glint.flows.cli.options import Json, print_lines
from glint.flows.cli.output import echo

INBOX = "inbox/nightly"
"""Name of the deployment that scans the inbox."""

MAX_SCANS = 10
"""Number of flow runs of the inbox that are listed, the newest ones."""


def worker(pool: Annotated[str, typer.Option(help="Name of the work pool to serve.")] = "glint") -> None:
    """Run scheduled work: start a worker for the pool of `glint deploy`, and the server if none is running."""
    from glint.flows.deployments.worker import has_pool, run_worker
    from glint.flows.runtime.prefect_server import ensure_server

    server = ensure_server()
    echo(f"dashboard {server.link()}")
    with server.connected():
        if not has_pool(pool):
            remedy = f"  -> check the name, or run `glint deploy --pool {quote(pool)}`"
            echo(f"nothing is deployed to a work pool {pool!r}\n{remedy}", colour="yellow", err=True)
        sys.exit(run_worker(server, pool))


def inbox(
    now: Annotated[bool, typer.Option("--now", help="Scan the inbox now, without waiting for its schedule.")] = False,
    as_json: Json = False,
) -> None:
    """List the latest and the next scans of the inbox."""
    from glint.flows.runtime.prefect_server import ensure_server

    server = ensure_server()
    from glint.flows.cli.tables import show, table_of
    from glint.flows.deployments.inbox_runs import inbox_runs, start_inbox_run, unserved_pool

    with server.connected():
        started = start_inbox_run(INBOX) if now else None
        rows = inbox_runs(INBOX, MAX_SCANS)
        pool = unserved_pool(INBOX)
    if as_json:
        print_lines({"kind": "scan", **row} for row in rows)
        return
    show(table_of(rows, "no scan yet: glint inbox --now"))
    if pool is not None:
        echo(f"no worker serves the inbox: glint worker --pool {quote(pool)}", colour="yellow")
    echo(f"dashboard: {server.link(f'runs/flow-run/{started}' if started else 'deployments')}")


def prefect(
    arguments: Annotated[
        list[str] | None, typer.Argument(metavar="ARGUMENTS ..", help="Arguments of Prefect's command.")
    ] = None,
) -> None:
    """Run Prefect's own command with the server's address and password, such as `glint prefect work-pool ls`."""
    from glint.flows.deployments.worker import run_prefect
    from glint.flows.runtime.prefect_server import ensure_server

    with ensure_server().connected():
        sys.exit(run_prefect(arguments or []))
