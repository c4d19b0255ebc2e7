"""`glint simulate`: captures of glass objects with their ground truth; also the catalogues of `glint evaluate`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glint.flows.cli.output import echo
from glint.flows.errors import RunningError

if TYPE_CHECKING:
    from glint.flows.reporting.events import Sink
    from glint.tasks.simulation.simulate import CaptureOptions

FORMER_OPTIONS = {
    "balls": "spheres",
    "ball_radius": "sphere_radius",
    "ball_diameter": "sphere_diameter",
    "lamp_radius": "light_radius",
    "lamp_distance": "light_distance",
}
"""Names under which options may still be set, and their present names."""
MAX_SIMULATED_FRAMES = 1_000_000
"""Frames of a simulated video, eleven hours of it: more is a mistake."""
DEGRADED_SHAPES = ("hemisphere", "fish", "wine-glass")
DEGRADED_OPTIONS = {"scale": 0.6, "frames": 1500, "seed": 3}
DEGRADED_QUICK_OPTIONS = {"scale": 0.4, "frames": 500, "seed": 3}
"""Options of degraded captures that their defect leaves open, at full size and with --quick."""


class SimulationError(RunningError):
    """A shape or an option that cannot be simulated."""


def simulate(
    shape: Annotated[
        str,
        typer.Argument(
            metavar="SHAPE",
            help="hemisphere, cylinder, jug, fish, wine-glass, water-glass, faceted-bottle, puppy, mug, goblet, "
            "tumbler, coupe, tankard, pitcher, hobnail-vase, ribbed-bottle, cut-bowl, bird, elephant, teddy-bear, "
            "hexagonal-prism, cut-cube, gem, ring, flask; `all` for the paper's six, the bottle, the puppy and the "
            "mug.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Folder of the catalogue; other shapes in it are kept."),
    ],
    frames: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=MAX_SIMULATED_FRAMES,
            help="Number of frames (default: as in the paper; 2,000 or 2,400 for other shapes).",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed of the light's path, the noise and the room.")] = 0,
    views: Annotated[int, typer.Option(min=1, max=360, help="Number of captures around a turntable.")] = 1,
    scale: Annotated[float, typer.Option(min=0.1, max=8.0, help="Size relative to the shape's usual one.")] = 1.0,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Set another option of docs/evaluation/simulation.md; repeatable."
        ),
    ] = None,
) -> None:
    """Render captures of transparent objects, with their ground truth, into a catalogue for `glint run`."""
    from glint.flows.reporting.console import open_console
    from glint.storage.replacement import restore_earlier
    from glint.tasks.simulation.simulate import PRESETS, SHAPES

    if shape != "all" and shape not in SHAPES:
        raise SimulationError(f"there is no shape {shape!r}", f"name one of {', '.join(SHAPES)}, or all")
    options = _parse_options({"frames": frames, "seed": seed, "views": views, "scale": scale}, settings or ())
    for name in PRESETS if shape == "all" else (shape,):
        _check_replaceable(out / name)
        if restore_earlier(out / name):
            echo(f"{out / name} is again as it was before a simulation that was killed", err=True)
    with open_console() as console:
        for name in PRESETS if shape == "all" else (shape,):
            _simulate(name, out, options, console)
    echo(f"next: glint run {quote(str(out / 'catalogue.yaml'))}")


def simulate_presets(out: Path, shapes: Sequence[str], scale: float, frames: int | None, console: "Sink") -> Path:
    """Simulate presets, except those that exist with the same options; return the catalogue's path."""
    from glint.tasks.simulation.simulate import CaptureOptions

    options = CaptureOptions(frames=frames, scale=scale)
    for shape in shapes:
        if not _exists(out / shape / "front", options):
            _simulate(shape, out, options, console)
    return out / "catalogue.yaml"


def simulate_degraded(out: Path, quick: bool, console: "Sink") -> Path:
    """Simulate each shape with each defect, except those that exist; return the path of their common catalogue."""
    from glint.tasks.simulation.simulate import DEGRADED

    options = DEGRADED_QUICK_OPTIONS if quick else DEGRADED_OPTIONS
    return simulate_variants(out, DEGRADED_SHAPES, DEGRADED, options, console)


def simulate_variants(
    out: Path,
    shapes: Sequence[str],
    variants: Mapping[str, Mapping[str, Any]],
    usual: Mapping[str, Any],
    console: "Sink",
) -> Path:
    """Simulate each shape with the options of each variant, except those that exist; return their common catalogue.

    usual: options that a variant leaves open. Objects are named SHAPE-VARIANT.
    """
    from glint.storage.catalogue.loading import Catalogue, load, write
    from glint.tasks.simulation.simulate import CaptureOptions

    objects = []
    for variant, changed in variants.items():
        folder, options = out / variant, CaptureOptions(**(dict(usual) | dict(changed)))
        for shape in shapes:
            if not _exists(folder / shape / "front", options):
                _simulate(shape, folder, options, console, name=f"{shape}-{variant}")
        simulated = {item.id: item for item in load(folder / "catalogue.yaml").objects}
        objects += [simulated[shape].model_copy(update={"id": f"{shape}-{variant}"}) for shape in shapes]
    # All variants of a shape stand next to each other.
    ordered = [item for shape in shapes for item in objects if item.id.startswith(f"{shape}-")]
    catalogue = Catalogue.model_validate({"schema": 1, "name": out.name, "objects": tuple(ordered)})
    write(catalogue, out / "catalogue.yaml")
    return out / "catalogue.yaml"


def _parse_options(values: Mapping[str, Any], settings: Sequence[str]) -> "CaptureOptions":
    """Combine options with those of NAME=VALUE settings.

    Raises:
        SimulationError: no such option, or a value that cannot be simulated.
    """
    from pydantic import TypeAdapter, ValidationError

    from glint.tasks.simulation.simulate import CaptureOptions

    known = [field.name for field in fields(CaptureOptions) if field.name not in values]
    malformed = [setting for setting in settings if "=" not in setting]
    if malformed:
        raise SimulationError(f"--set {malformed[0]} gives no value", f"write --set {malformed[0]}=VALUE")
    pairs = [setting.partition("=")[::2] for setting in settings]
    named = {FORMER_OPTIONS.get(name, name): value for name, value in pairs}
    unknown = [name for name in named if name not in known]
    if unknown:
        raise SimulationError(f"there is no option {unknown[0]!r}", f"set one of {', '.join(known)}")
    try:
        return TypeAdapter(CaptureOptions).validate_python(dict(values) | named)
    except ValidationError as error:
        detail = error.errors()[0]
        # What CaptureOptions refuses itself names the option already.
        place = "".join(f"{name}={detail['input']}: " for name in detail["loc"][:1])
        reason = place + detail["msg"].removeprefix("Value error, ")
        raise SimulationError(
            reason, "see `glint simulate --help`, and docs/evaluation/simulation.md for --set"
        ) from None


def _simulate(shape: str, out: Path, options: "CaptureOptions", console: "Sink", name: str = "") -> None:
    from glint.flows.reporting.events import ProgressThrottle
    from glint.tasks.simulation.simulate import simulate as render

    render(shape, out, options, ProgressThrottle(console.emit, name or shape, "simulate", unit="frames"))


def _check_replaceable(folder: Path) -> None:
    """Refuse to write a simulated object over a folder that holds anything else, such as a person's own videos.

    Raises:
        SimulationError: it does.
    """
    if not folder.is_dir():
        return
    strange = [
        file for file in folder.iterdir() if file.name != "truth_model.ply" and not (file / "meta.json").is_file()
    ]
    if strange:
        raise SimulationError(
            f"{folder} holds {strange[0].name}, which was not simulated", "give another folder with --out"
        )


def _exists(folder: Path, options: "CaptureOptions") -> bool:
    """Return whether the folder holds a capture that was simulated with these options."""
    try:
        stored = json.loads((folder / "meta.json").read_text())
    except (OSError, ValueError):
        return False
    return all(stored.get(name) == value for name, value in asdict(options).items())
