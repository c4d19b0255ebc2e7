"""`glint simulate`: captures of glass objects with their truth, one after the other, with progress."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import typer
from pydantic import TypeAdapter, ValidationError

from glint.flows.errors import RunningError
from glint.flows.reporting.console import open_console
from glint.flows.reporting.events import ProgressThrottle, Sink
from glint.tasks.simulation.simulate import PRESETS, SHAPES, CaptureOptions, simulate


class SimulationError(RunningError):
    """A shape or an option that cannot be simulated."""


def simulate_shapes(
    shape: str,
    out: Path,
    *,
    frames: int | None,
    seed: int,
    views: int,
    scale: float,
    others: Sequence[str] = (),
    as_json: bool = False,
) -> None:
    """Simulate a shape, or `all` of the paper's, into a catalogue; others: NAME=VALUE of `CaptureOptions`."""
    if shape != "all" and shape not in SHAPES:
        raise SimulationError(f"there is no shape {shape!r}", f"name one of {', '.join(SHAPES)}, or all")
    options = _options({"frames": frames, "seed": seed, "views": views, "scale": scale}, others)
    with open_console(as_json) as display:
        for each in PRESETS if shape == "all" else (shape,):
            _simulate(each, out, options, display)
    typer.echo(f"next: glint run {out / 'catalogue.yaml'}")


def simulate_presets(out: Path, scale: float, frames: int | None, display: Sink) -> Path:
    """The paper's six captures as a catalogue; those that are there already, made alike, are kept."""
    options = CaptureOptions(frames=frames, scale=scale)
    for shape in PRESETS:
        if not _is_there(out / shape / "front", options):
            _simulate(shape, out, options, display)
    return out / "catalogue.yaml"


def _options(given: Mapping[str, Any], others: Sequence[str]) -> CaptureOptions:
    """The options that are given, and those of NAME=VALUE.

    Raises:
        SimulationError: no such option, or a value that cannot be simulated.
    """
    known = [each.name for each in fields(CaptureOptions) if each.name not in given]
    named = dict(each.partition("=")[::2] for each in others)
    unknown = [name for name in named if name not in known]
    if unknown:
        raise SimulationError(f"there is no option {unknown[0]!r}", f"set one of {', '.join(known)}")
    try:
        return TypeAdapter(CaptureOptions).validate_python(dict(given) | named)
    except ValueError as error:
        reason = str(error.errors()[0]["msg"]) if isinstance(error, ValidationError) else str(error)
        raise SimulationError(f"{', '.join(others) or given}: {reason}", "see `glint simulate --help`") from None


def _simulate(shape: str, out: Path, options: CaptureOptions, display: Sink) -> None:
    simulate(shape, out, options, ProgressThrottle(display.emit, shape, "simulate"))


def _is_there(folder: Path, options: CaptureOptions) -> bool:
    from dataclasses import asdict

    try:
        said = json.loads((folder / "meta.json").read_text())
    except (OSError, ValueError):
        return False
    return all(said.get(name) == value for name, value in asdict(options).items())
