"""Captures of simulated shapes, each to be measured alone, and the command line of programs that measure them."""

import argparse
import json
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from glint.storage.catalogue.loading import Capture, load
from glint.tasks.simulation.simulate import CaptureOptions, simulate


def shapes_parser(description: str | None, **defaults: float) -> argparse.ArgumentParser:
    """Return a command line of shapes, of a folder, and of an option for each of `defaults`, such as `--seed`."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", metavar="SHAPE")
    parser.add_argument("--folder", type=Path, help="folder for captures and stores; a temporary one by default")
    for name, default in defaults.items():
        parser.add_argument(f"--{name}", type=type(default), default=default)
    return parser


def simulated_once(shape: str, folder: Path, options: CaptureOptions) -> Capture:
    """Return the only capture of a shape, simulated into a folder unless that holds it with the same options."""
    path = folder / shape / "front" / "meta.json"
    description = json.loads(path.read_text()) if path.exists() else {}
    if any(description.get(name, ...) != value for name, value in asdict(options).items()):
        simulate(shape, folder, options)
    (capture,) = load(folder / "catalogue.yaml").object(shape).captures
    return capture


def simulated_captures(
    shapes: Iterable[str], folder: Path | None, options: CaptureOptions
) -> Iterator[tuple[str, Capture, Path]]:
    """Simulate shapes into a folder, None: a temporary one.

    Yields SHAPE/CAPTURE, the capture without its pose, and the folder of a store of its own.
    """
    with tempfile.TemporaryDirectory() as temporary:
        for shape in shapes:
            target = (folder or Path(temporary)) / shape
            for capture in load(simulate(shape, target, options).catalogue).object(shape).captures:
                alone = capture.model_copy(update={"pose": None})
                yield f"{shape}/{capture.id}", alone, target / f"store-{capture.id}"
