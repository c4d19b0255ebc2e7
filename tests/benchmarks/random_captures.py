"""Random captures of all shapes but ring and flask: which of them have confident normals that are wrong.

    python -m tests.benchmarks.random_captures [SHAPE ...] [--seed 6000] [--count 46] [--given 1] [--bare 1]
        [--tables 1] [--folder DIR]

Size, frames, camera, spheres, light, compression, noise and exposure of each capture follow from its seed: the first
seed, the next, and so on, shapes taking turns. A third of the captures has no mask, half has no spheres; with `--given
1` masks and spheres are given, with `--bare 1` no mask is. With `--tables 1` the objects and spheres stand on tables
with their shadows and caustics, seen from above or aslant, plain or textured; captures are then shorter, for each frame
takes 0.2 seconds. Captures that DIR holds with the same options are not simulated again.

Of each it prints the mean error, the share of the mask at confidence 0.95 and of these the share within 5 degrees, the
causes that warnings name, and BROKEN where fewer than 95% of more than half a percent are right and no warning comes
with less than 5%, or why it is refused; at last the geometric mean of the errors.
"""

import argparse
import random
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.evaluation.captures import CONFIDENT_ERROR_DEG
from glint.tasks.simulation.simulate import SHAPES, CaptureOptions
from glint.tasks.stages.capture_geometry import load_geometry
from tests.benchmarks.simulated_captures import shapes_parser, simulated_once
from tests.tasks.make_context import perform_all

TURNS = tuple(shape for shape in SHAPES if shape not in ("ring", "flask"))
"""Shapes that take turns where none is named: figures that docs/evaluation quotes are of their seeds."""
STAGES = ("survey", "lights", "mask", "labels")
"""Stages whose warnings name the causes of doubt."""
MIN_RIGHT, MIN_CONFIDENT, MAX_WARNED = 0.95, 0.005, 0.05
"""Share of the confident pixels that must be right, and shares of the mask: below the first hardly any pixel is
confident, below the second a warning suffices."""


def random_capture(shape: str, seed: int, folder: Path, *, is_given: bool, is_on_table: bool = False) -> Capture:
    """Simulate a capture of a shape whose options follow from its seed, unless the folder holds it.

    is_given: whether mask and spheres are given in any case. is_on_table: with shadows and caustics on a table; what
    else is drawn is the same, but for length and size.
    """
    draw = random.Random(seed)
    options = CaptureOptions(
        seed=seed,
        focal=draw.choice([None, None, round(draw.uniform(0.8, 2.0), 2)]),
        spheres=draw.choice([1, 1, 2]),
        light_distance=draw.choice([None, None, 2.5, 5.0, 10.0]),
        light_radius=round(draw.uniform(3.0, 8.0), 1),
        crf=draw.randint(14, 30),
        noise=round(draw.uniform(1.0, 4.0), 1),
        exposure_drift=draw.choice([0.0, 0.0, 0.05, 0.1, 0.2]),
        sphere_radius=float(draw.randint(20, 45)),
        scale=round(draw.uniform(0.4, 0.7), 2),
        frames=draw.randint(500, 1200),
    )
    if is_on_table:
        options = _on_table(options)
    capture = simulated_once(shape, folder, options)
    without_mask, without_spheres = draw.random() < 1 / 3, draw.random() < 1 / 2
    missing = {"mask": None} if without_mask and not is_given else {}
    return capture.model_copy(update=missing | ({"spheres": ()} if without_spheres and not is_given else {}))


def _on_table(options: CaptureOptions) -> CaptureOptions:
    """Return the options of a shorter, smaller capture on a table; all else that was drawn from the seed stays."""
    draw = random.Random(f"table {options.seed}")
    return replace(
        options,
        shadows=True,
        table_tilt=draw.choice([0.0, round(draw.uniform(20.0, 65.0), 1)]),
        table_contrast=draw.choice([0.0, 0.3, 1.0]),
        scale=round(draw.uniform(0.4, 0.6), 2),
        frames=draw.randint(500, 600),
    )


def random_captures(
    arguments: argparse.Namespace, *, is_given: bool, is_on_table: bool = False
) -> Iterator[tuple[str, Capture, Path]]:
    """Simulate as many captures as the command line says, shapes taking turns; see `random_capture`.

    Yields SHAPE, seed N, the capture, and the folder of a store of its own.
    """
    shapes = arguments.shapes or TURNS
    with tempfile.TemporaryDirectory() as temporary:
        for number in range(arguments.count):
            shape, seed = shapes[number % len(shapes)], arguments.seed + number
            folder = (arguments.folder or Path(temporary)) / str(seed)
            capture = random_capture(shape, seed, folder, is_given=is_given, is_on_table=is_on_table)
            yield f"{shape}, seed {seed}", capture, folder / "store"


@dataclass(frozen=True, slots=True)
class Measured:
    """Results of a capture beside the truth.

    work: performed up to its labels. error (H, W): degrees between resulting and true normals, NaN beside the object.
    mask, confident (H, W) bool. truth (H, W, 3): true normals, camera frame, NaN beside the object.
    """

    work: CaptureContext
    error: np.ndarray
    mask: np.ndarray
    confident: np.ndarray
    truth: np.ndarray

    @property
    def mean_error(self) -> float:
        """Mean angle between resulting and true normals in the mask, degrees."""
        return float(np.nanmean(self.error[self.mask]))

    @property
    def share(self) -> float:
        """Share of the mask that is confident."""
        return float(self.confident.sum() / self.mask.sum())

    @property
    def right(self) -> float:
        """Share of the confident pixels that are right, a pixel of the mask beside the object being wrong."""
        error = self.error[self.confident]
        return float((error < CONFIDENT_ERROR_DEG).mean()) if error.size else 1.0


def measure(capture: Capture, store: Path, parameters: Parameters | None = None) -> Measured:
    """Perform a capture up to its labels, its results kept in a store, and compare its normals with the truth."""
    work = CaptureContext(str(store), "object", capture, parameters or Parameters(), "random")
    perform_all(work, "labels")
    mask, labels = work.load("mask").read("mask"), work.load("labels")
    assert capture.truth is not None
    assert capture.region is not None
    given = read_truth(capture.truth, (capture.region.height, capture.region.width)).normals
    assert given is not None
    width, height = load_geometry(work).frame_size
    frame = np.full((height, width, 3), np.nan)
    frame[capture.region.rows, capture.region.columns] = given
    region = load_geometry(work).region
    truth = frame[region.rows, region.columns]
    is_confident = mask & (labels.read("confidence") >= CONFIDENT)
    return Measured(work, angles(labels.read("normals"), truth), mask, is_confident, truth)


def outcome(measured: Measured) -> str:
    """Return a line on one capture."""
    work, share, right = measured.work, measured.share, measured.right
    causes = {warning["cause"] for stage in STAGES for warning in work.load(stage).record["warnings"]}
    is_broken = right < MIN_RIGHT and share >= (MAX_WARNED if causes else MIN_CONFIDENT)
    line = f"{measured.mean_error:.1f} degrees, {share:.1%}, {right:.1%} right ({', '.join(sorted(causes))})"
    return line + (" BROKEN" if is_broken else "")


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, seed=6000, count=46, given=0, bare=0, tables=0).parse_args()
    errors = []
    captures = random_captures(arguments, is_given=bool(arguments.given), is_on_table=bool(arguments.tables))
    for name, given, store in captures:
        capture = given.model_copy(update={"mask": None}) if arguments.bare else given
        try:
            measured = measure(capture, store)
        except UnusableCapture as error:
            print(f"{name}: refused, {error}", flush=True)
            continue
        errors.append(measured.mean_error)
        print(f"{name}: {outcome(measured)}", flush=True)
    print(f"geometric mean of the errors: {np.exp(np.log(errors).mean()):.2f} degrees")


if __name__ == "__main__":
    main()
