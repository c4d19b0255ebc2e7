"""Captures of a simulated shape, each to be measured alone."""

from collections.abc import Iterator
from pathlib import Path

from glint.storage.catalogue.loading import Capture, load
from glint.tasks.simulation.simulate import CaptureOptions, simulate


def simulated_captures(shape: str, folder: Path, options: CaptureOptions) -> Iterator[tuple[Capture, Path]]:
    """Simulate a shape into a folder; yield its captures without their poses, and the folder of a store for each."""
    for capture in load(simulate(shape, folder, options).catalogue).object(shape).captures:
        yield capture.model_copy(update={"pose": None}), folder / f"store-{capture.id}"
