"""The `glint` command: its sub-commands, and how errors are printed.

A command's module imports what is slow to import when the command runs, so that `glint --help` answers at once.
"""

import sys

import typer

from glint.flows.cli.catalogue import catalogue
from glint.flows.cli.check import check
from glint.flows.cli.dashboard import dashboard
from glint.flows.cli.demo import demo
from glint.flows.cli.deploy import deploy
from glint.flows.cli.diff import diff
from glint.flows.cli.evaluate import evaluate
from glint.flows.cli.export import export
from glint.flows.cli.history import history, rollback
from glint.flows.cli.maintain import maintain
from glint.flows.cli.output import echo
from glint.flows.cli.run import run
from glint.flows.cli.simulate import simulate
from glint.flows.cli.status import status
from glint.flows.runtime import signals

COMMANDS = (
    demo,
    simulate,
    catalogue,
    check,
    run,
    status,
    history,
    diff,
    maintain,
    rollback,
    export,
    evaluate,
    deploy,
    dashboard,
)
"""In the order of `glint --help`."""

USAGE_ERROR = 2
"""Exit status of wrong usage and of errors that have a remedy."""

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # Rich draws boxes round the help and takes as long to import as all the rest of the command.
    rich_markup_mode=None,
    context_settings={"max_content_width": 120},
    help="Reconstruct the surfaces of transparent objects from videos of their highlights.",
    epilog="Exit status: 0 success, 1 some captures failed, 2 wrong usage or an unusable catalogue or store.",
)
for command in COMMANDS:
    app.command()(command)


def main() -> None:
    """Run the command line.

    Errors that have a remedy, and errors about a file, are printed in two lines, without a traceback. SIGTERM is
    handled as an interrupt: workers end, and the dashboard shows that the run was interrupted.
    """
    signals.install()
    try:
        app()
    except Exception as error:
        message, remedy = getattr(error, "message", error), getattr(error, "remedy", None)
        if remedy is None and isinstance(error, OSError) and error.filename is not None:
            message, remedy = f"{error.filename}: {error.strerror}", "check the path and its permissions"
        if remedy is None:
            raise
        echo(f"glint: {message}", colour="red", err=True)
        echo(f"  -> {remedy}", err=True)
        sys.exit(USAGE_ERROR)
