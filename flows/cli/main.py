"""The `glint` command: its sub-commands, and how errors are printed.

A command's module imports what is slow to import when the command runs, so that `glint --help` answers at once.
"""

import errno
import os
import sys
from contextlib import suppress
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from glint.flows.cli.catalogue import catalogue
from glint.flows.cli.check import check
from glint.flows.cli.dashboard import dashboard
from glint.flows.cli.demo import demo
from glint.flows.cli.deploy import deploy
from glint.flows.cli.diff import diff
from glint.flows.cli.edits import edits
from glint.flows.cli.evaluate import evaluate
from glint.flows.cli.export import export
from glint.flows.cli.history import history, rollback
from glint.flows.cli.maintain import maintain
from glint.flows.cli.output import echo
from glint.flows.cli.review import review
from glint.flows.cli.run import run
from glint.flows.cli.simulate import simulate
from glint.flows.cli.status import status
from glint.flows.cli.verify import verify
from glint.flows.cli.worker import inbox, prefect, worker
from glint.flows.runtime import signals

COMMANDS = (
    demo,
    simulate,
    catalogue,
    check,
    run,
    review,
    status,
    history,
    edits,
    diff,
    maintain,
    verify,
    rollback,
    export,
    evaluate,
    deploy,
    worker,
    inbox,
    prefect,
    dashboard,
)
"""The commands in the order of `glint --help`."""

USAGE_ERROR = 2
"""Exit status of wrong usage and of errors that have a remedy."""

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a write for which there is no room."""


def print_version(is_given: bool) -> None:
    """Print the version and end the command, if `--version` is given."""
    if is_given:
        from importlib.metadata import version

        echo(f"glint {version('glint')}")
        raise typer.Exit


def common_options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=print_version, help="Show the version and exit.")
    ] = False,
) -> None:
    """Accept the options that stand before a command."""


app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # Rich draws boxes round the help and takes as long to import as all the rest of the command.
    rich_markup_mode=None,
    context_settings={"max_content_width": 120},
    callback=common_options,
    help="Reconstruct the surfaces of transparent objects from videos of their highlights.",
    epilog="Exit status: 0 success, 1 some captures failed, 2 wrong usage or an unusable catalogue or store.",
)


class Command(TyperCommand):
    """A command whose usage errors show the value that is wrong."""

    def make_context(self, *given: Any, **options: Any) -> Any:
        """Parse the command line.

        Raises:
            typer.BadParameter: a value is wrong.
        """
        try:
            return super().make_context(*given, **options)
        except typer.BadParameter as error:
            from pydantic import ValidationError

            from glint.storage.catalogue.messages import fault_of

            if isinstance(error.__cause__, ValidationError):
                error.message = fault_of(error.__cause__.errors(include_url=False)[0])
            raise


for command in COMMANDS:
    # What follows `glint prefect` is Prefect's, its options and --help included.
    passes_on = {"ignore_unknown_options": True, "help_option_names": []} if command is prefect else {}
    app.command(cls=Command, context_settings=passes_on)(command)


def main() -> None:
    """Run the command line.

    Errors that have a remedy, and errors about a file, are printed in two lines, without a traceback. SIGTERM is
    handled as an interrupt: workers end, and the dashboard shows that the run was interrupted.
    """
    signals.install()
    try:
        try:
            app()
        finally:
            # Python remembers an interrupt that ended the execution of a string (where a data class is defined, say)
            # even when it was handled, and `python -m` would end by the signal rather than with the status. The next
            # string that is executed makes it forget.
            exec("")
            sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or signals.was_interrupted():
            # Libraries turn an interrupt into errors of their own.
            sys.exit(signals.EXIT_STATUS)
        described = _described(error)
        if described is None:
            raise
        with suppress(OSError):
            echo(f"glint: {described[0]}", colour="red", err=True)
            echo(f"  -> {described[1]}", err=True)
        # What is still buffered for a full disk or a closed pipe would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(USAGE_ERROR)


def _described(error: Exception) -> tuple[str, str] | None:
    """Return message and remedy of an error that a user can fix, None of any other."""
    remedy = getattr(error, "remedy", None)
    if remedy is not None:
        return str(getattr(error, "message", error)), str(remedy)
    if isinstance(error, MemoryError):
        return f"there is not enough memory ({error or 'none is left'})", "end other programs, or ask for less"
    if not isinstance(error, OSError):
        return None
    place = "" if error.filename is None else f"{error.filename}: "
    if error.errno in DISK_FULL:
        return f"{place}{error.strerror}", "free space on the disk that is written to, or name another with --out"
    return (f"{place}{error.strerror}", "check the path and its permissions") if place else None
