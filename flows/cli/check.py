"""`glint check`: examine captures in this process, before the long stages."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from glint.flows.cli.options import CatalogueFile, Json, Only, Store, chosen_store, print_lines, store_option
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.flows.reporting.events import Sink
    from glint.tasks.check import Check


def check(
    file: CatalogueFile,
    only: Only = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pictures.")] = Path("glint-check"),
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Check captures before the long stages: spheres, lights, coverage, and what to record again."""
    from glint.flows.errors import USER_ERRORS
    from glint.flows.reporting.console import open_console
    from glint.flows.reporting.events import CaptureEnded, CaptureFailed
    from glint.storage.locations.conditional_writes import check_conditional_writes
    from glint.storage.locations.location import Location
    from glint.tasks.check import check as check_capture
    from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue

    chosen = chosen_captures(load_catalogue(file).objects, only or ())
    place = Location.parse(chosen_store(store))
    check_conditional_writes(place)
    checks, failed = list["Check"](), 0
    with open_console(as_json) as console:
        for object_id, capture_id in ((name, capture) for name, captures in chosen.items() for capture in captures):
            reference = CaptureReference(Location.parse(file).uri, object_id, capture_id, place.uri, "check")
            name = str(reference)
            try:
                result = check_capture(reference.context(), out / object_id / capture_id, _progress(console, name))
            except USER_ERRORS as error:
                failed += 1
                console.emit(CaptureFailed(name, str(error)))
            else:
                checks.append(result)
                console.emit(CaptureEnded(name, result.seconds))
    if as_json:
        pictures = [[str(path) for path in result.pictures] for result in checks]
        lines = [asdict(result) | {"pictures": paths} for result, paths in zip(checks, pictures, strict=True)]
        print_lines({"kind": "check", **line} for line in lines)
    else:
        _print_checks(checks, out)
        echo(f"next: glint run {file}{store_option(store)}")
    sys.exit(1 if failed else 0)


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
            "frames": result.frames,
            "lights": result.lights,
            "observable": f"{result.could:.0%}",
            "observed": f"{result.observed:.0%}",
            "spheres": "; ".join(result.spheres) or "none (lights given)",
        }
        for result in checks
    ]
    show(table_of(rows, "no capture can be used"))
    for result in checks:
        for warning in result.warnings:
            echo(f"{result.name}: {warning.message}", colour="yellow")
    if checks:
        echo("observable: share of the object where a light in front of it can cause a highlight")
        echo("observed: share of the object where a highlight was recorded")
        echo(f"pictures (coverage, overview, keyframes to mark highlights on): {out}")
