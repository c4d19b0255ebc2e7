"""`glint dashboard`: the address of the dashboard."""

from typing import Annotated

import typer

from glint.flows.cli.output import echo


def dashboard(
    stop: Annotated[bool, typer.Option("--stop", help="Stop the embedded server.")] = False,
) -> None:
    """Print a link that opens the dashboard once; start the embedded server if none is running."""
    from glint.flows.runtime.prefect_server import ensure_server, stop_server

    if stop:
        echo("the embedded server was stopped" if stop_server() else "no embedded server was running")
    else:
        echo(ensure_server().link())
