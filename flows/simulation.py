"""`glint simulate`: captures of glass objects with their truth, one after the other, with progress."""

import json
from pathlib import Path

import typer

from flows.errors import RunningError
from flows.progress import Display, Reporter, open_display
from tasks.simulation import PRESETS, SHAPES, CaptureOptions, simulate


class SimulationError(RunningError):
    """A shape or an option that cannot be simulated."""


def simulate_shapes(
    shape: str, out: Path, *, frames: int | None, seed: int, views: int, scale: float, as_json: bool = False
) -> None:
    """Simulate a shape, or `all` of the paper's, into a catalogue."""
    if shape != "all" and shape not in SHAPES:
        raise SimulationError(f"there is no shape {shape!r}", f"name one of {', '.join(SHAPES)}, or all")
    options = CaptureOptions(frames=frames, seed=seed, views=views, scale=scale)
    with open_display(as_json) as display:
        for each in PRESETS if shape == "all" else (shape,):
            _simulate(each, out, options, display)
    typer.echo(f"next: glint run {out / 'catalogue.yaml'}")


def simulate_presets(out: Path, scale: float, frames: int | None, display: Display) -> Path:
    """The paper's six captures as a catalogue; those that are there already, made alike, are kept."""
    options = CaptureOptions(frames=frames, scale=scale)
    for shape in PRESETS:
        if not _is_there(out / shape / "front", options):
            _simulate(shape, out, options, display)
    return out / "catalogue.yaml"


def _simulate(shape: str, out: Path, options: CaptureOptions, display: Display) -> None:
    simulate(shape, out, options, Reporter(display.show, shape, "simulate"))


def _is_there(folder: Path, options: CaptureOptions) -> bool:
    from dataclasses import asdict

    try:
        said = json.loads((folder / "meta.json").read_text())
    except (OSError, ValueError):
        return False
    return all(said.get(name) == value for name, value in asdict(options).items())
