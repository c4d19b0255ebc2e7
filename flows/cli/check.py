"""`glint check`: every chosen capture looked at, in this process; what is found is told, and drawn."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import typer

from glint.flows.cli.tables import show, table_of
from glint.flows.errors import USER_ERRORS
from glint.flows.reporting.console import open_console
from glint.flows.reporting.events import CaptureEnded, CaptureFailed, ProgressThrottle
from glint.storage.locations.location import Location
from glint.storage.locations.probe import probe
from glint.tasks.check import Check, check
from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue


def check_catalogue(file: str | Path, store: str, out: Path, only: Sequence[str], as_json: bool) -> int:
    """Check captures one after the other; the command's exit status."""
    chosen = chosen_captures(load_catalogue(file).objects, only)
    probe(Location.parse(store))
    catalogue = Location.parse(file).uri
    place, found, refused = Location.parse(store).uri, list[Check](), dict[str, Exception]()
    with open_console(as_json) as display:
        for object_id, captures in chosen.items():
            for capture_id in captures:
                reference = CaptureReference(catalogue, object_id, capture_id, place, "check")
                reporters: dict[str, ProgressThrottle] = {}

                def tell(stage: str, done: int, total: int | None, name: str = str(reference)) -> None:
                    reporters.setdefault(stage, ProgressThrottle(display.emit, name, stage))(done, total)  # noqa: B023

                try:
                    found.append(check(reference.workspace(), out / object_id / capture_id, tell))
                    display.emit(CaptureEnded(str(reference), found[-1].seconds))
                except USER_ERRORS as error:
                    refused[str(reference)] = error
                    display.emit(CaptureFailed(str(reference), str(error)))
    if not as_json:
        _tell(found, out)
    else:
        for each in found:
            facts = asdict(each) | {"pictures": [str(path) for path in each.pictures]}
            typer.echo(json.dumps({"kind": "check", **facts}))
    return 1 if refused else 0


def _tell(found: Sequence[Check], out: Path) -> None:
    rows = [
        {
            "capture": each.name,
            "frames": each.frames,
            "lights": each.lights,
            "could glint": f"{each.could:.0%}",
            "glinted": f"{each.observed:.0%}",
            "spheres": "; ".join(each.spheres) or "lights given",
        }
        for each in found
    ]
    show(table_of(rows, "no capture can be used"))
    for each in found:
        for warning in each.warnings:
            typer.secho(f"{each.name}: {warning}", fg="yellow")
    if found:
        typer.echo(f"pictures (coverage, overview, keyframes to mark highlights on): {out}")
