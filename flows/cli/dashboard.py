"""`glint dashboard`: the address of the dashboard."""

from typing import Annotated

import typer

from glint.flows.cli.output import echo


def dashboard(
    stop: Annotated[bool, typer.Option("--stop", help="Stop Glint's own server.")] = False,
) -> None:
    """Print a link that opens the dashboard once; start Glint's own server if none is running."""
    from glint.flows.runtime.prefect_server import ensure_server, stop_server

    if stop:
        echo("Glint's own server was stopped" if stop_server() else "Glint's own server was not running")
    else:
        echo(ensure_server().link())
