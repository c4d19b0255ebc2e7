"""`glint check`: examine captures in this process, before the long stages."""

import logging
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from glint.flows.cli.options import (
    CatalogueFile,
    Json,
    Only,
    Store,
    chosen_store,
    json_line,
    print_lines,
    store_option,
)
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.flows.reporting.events import Sink
    from glint.tasks.check import Check
    from glint.tasks.engine.capture_context import CaptureContext
    from glint.tasks.engine.references import CaptureReference

LOG = logging.getLogger(__name__)


def check(
    file: CatalogueFile,
    only: Only = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pictures.")] = Path("glint-check"),
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Check captures before the long stages: spheres, lights, coverage, and what to record again."""
    from glint.flows.pipeline.preflight import report_input_errors
    from glint.flows.reporting.console import open_console
    from glint.storage.locations.conditional_writes import check_conditional_writes
    from glint.storage.locations.location import Location
    from glint.tasks.check import with_agreement
    from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue

    catalogue, address = load_catalogue(file), Location.parse(file).uri
    chosen = chosen_captures(catalogue.objects, only or ())
    place = Location.parse(chosen_store(store))
    check_conditional_writes(place)
    checks, is_complete = list["Check"](), True
    with open_console(as_json) as console:
        report_input_errors(catalogue, chosen, console)
        for object_id, capture_ids in chosen.items():
            of_object = [
                _checked(CaptureReference(address, object_id, capture_id, place.uri, "check"), out, console)
                for capture_id in capture_ids
            ]
            known = [checked for checked in of_object if checked is not None]
            is_complete = is_complete and len(known) == len(of_object)
            checks += with_agreement(known)
    if as_json:
        print_lines(json_line("check", result, name="capture") for result in checks)
    else:
        _print_checks(checks, out)
        _print_next(checks, file, store)
    sys.exit(0 if is_complete and not any(result.error for result in checks) else 1)


def _checked(reference: "CaptureReference", out: Path, console: "Sink") -> "tuple[CaptureContext, Check] | None":
    """Check a capture, with its pictures in OUT/OBJECT/CAPTURE, and report its end; None: it could not be checked.

    Raises:
        OutputError: the pictures cannot be written, those of the other captures neither.
    """
    from glint.flows.errors import USER_ERRORS, message_and_remedy
    from glint.flows.reporting.events import CaptureEnded, CaptureFailed
    from glint.storage.errors import OutputError
    from glint.tasks.check import check as check_capture

    name = str(reference)
    try:
        context = reference.context()
        folder = out / reference.object_id / reference.capture_id
        result = check_capture(context, folder, _progress(console, name))
    except OutputError:
        raise
    except Exception as error:
        # Whatever is wrong with one capture does not keep the others from being checked.
        if not isinstance(error, USER_ERRORS):
            LOG.exception("%s", name)
        console.emit(CaptureFailed(name, ": ".join(message_and_remedy(error))))
        return None
    console.emit(CaptureFailed(name, result.error) if result.error else CaptureEnded(name, result.seconds))
    return context, result


def _progress(console: "Sink", capture: str) -> Callable[[str, int, int | None], None]:
    """Return the progress callback (stage, done, total) of a capture."""
    from glint.flows.reporting.events import ProgressThrottle

    reporters: dict[str, ProgressThrottle] = {}

    def report(stage: str, done: int, total: int | None) -> None:
        if stage not in reporters:
            reporters[stage] = ProgressThrottle(console.emit, capture, stage)
        reporters[stage](done, total)

    return report


def _print_checks(checks: "Sequence[Check]", out: Path) -> None:
    from glint.flows.cli.tables import show, table_of

    rows = [
        {
            "capture": result.name,
            "frames": "" if result.frames is None else result.frames,
            "lights": "" if result.lights is None else result.lights,
            "observable": "" if result.observable is None else f"{result.observable:.0%}",
            "observed": "" if result.observed is None else f"{result.observed:.0%}",
            "verdict": result.verdict.word,
        }
        for result in checks
    ]
    show(table_of(rows, "no capture can be used"))
    # Long names and reasons have lines of their own: in a terminal's columns they would be cut to pieces.
    for result in checks:
        reason = f"{result.verdict.word}: {result.error}" if result.error else str(result.verdict)
        echo(f"\n{result.name}: {reason}")
        if result.spheres:
            echo(f"  spheres: {'; '.join(result.spheres)}")
        if result.picture is not None:
            echo(f"  look at: {result.picture}")
        for warning in result.warnings:
            echo(f"  warning: {warning.message}", colour="yellow")
    if checks:
        echo()
        echo(f"pictures (coverage, overview, keyframes to mark highlights on): {out}")
        echo("docs/commands.md explains the columns and the verdicts")


def _print_next(checks: "Sequence[Check]", file: str, store: str | None) -> None:
    """Print the commands that follow: to correct inputs, to run what can be used, or else to check again."""
    from glint.tasks.verdict import GOOD, USABLE

    arguments = f"{quote(file)}{store_option(store)}"
    if any(result.verdict.word not in (GOOD, USABLE) for result in checks):
        echo(f"to correct inputs on their pictures: glint review {arguments}")
    if any(not result.error for result in checks):
        echo(f"next: glint run {arguments}")
    else:
        fault = "the verdicts name" if checks else "failed"
        echo(f"next: correct what {fault}, then glint check {arguments}")
