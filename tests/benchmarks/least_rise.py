"""Which highlights count: the errors of random captures by how far a highlight must rise.

    python -m tests.benchmarks.least_rise [SHAPE ...] [--seed 32000] [--count 46] [--rises 0.85 0.65] [--folder DIR]

The captures are those of `random_captures` whose spheres and masks are given. Of each it prints the threshold that
follows from its lights, and for this and each of the others the squared error over the whole mask, the share of
the mask that is confident, and of this the share within 5 degrees; at last the geometric mean of the errors, relative
to the first of the others.
"""

import tempfile
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.evaluation.captures import CONFIDENT_ERROR_DEG
from glint.tasks.simulation.simulate import SHAPES
from tests.benchmarks.random_captures import random_capture
from tests.benchmarks.simulated_captures import shapes_parser
from tests.tasks.make_context import perform_all


def measure(capture: Capture, store: Path, rise: float | None) -> tuple[float, str]:
    """Return the squared error of a capture's normals and a line on them; rise: None for that of its lights."""
    parameters = Parameters.model_validate({"thresholds": {"threshold": rise}})
    work = CaptureContext(str(store), "object", capture, parameters, "benchmark")
    perform_all(work, "labels")
    mask, labels = work.load("mask").read("mask"), work.load("labels")
    assert capture.truth is not None
    truth = read_truth(capture.truth, mask.shape).normals
    assert truth is not None
    normals, confident = labels.read("normals"), mask & (labels.read("confidence") >= CONFIDENT)
    error, right = squared_errors(normals, truth, mask), (angles(normals, truth)[confident] < CONFIDENT_ERROR_DEG)
    share = right.mean() if right.size else 1.0
    return error, f"{error:.4f}, {confident.sum() / mask.sum():.0%}, {share:.1%}"


def main() -> None:
    """Print a line per capture as it is measured, then the means."""
    parser = shapes_parser(__doc__, seed=32000, count=46)
    parser.add_argument("--rises", type=float, nargs="+", default=[0.85, 0.75, 0.65])
    arguments = parser.parse_args()
    shapes, errors = arguments.shapes or SHAPES, []
    with tempfile.TemporaryDirectory() as temporary:
        for number in range(arguments.count):
            shape, seed = shapes[number % len(shapes)], arguments.seed + number
            folder = (arguments.folder or Path(temporary)) / str(seed)
            capture, store = random_capture(shape, seed, folder, is_given=True), folder / "store"
            measured = [measure(capture, store, rise) for rise in (*arguments.rises, None)]
            errors.append([error for error, _ in measured])
            chosen = CaptureContext(str(store), "object", capture, Parameters(), "benchmark").load("thresholds")
            lines = [f"{rise:g}: {line}" for rise, (_, line) in zip(arguments.rises, measured, strict=False)]
            lines.append(f"by the lights {chosen.record['threshold']:g}: {measured[-1][1]}")
            print(f"{shape}, seed {seed}: {'; '.join(lines)}", flush=True)
    means = np.exp(np.log(np.array(errors) / np.array(errors)[:, :1]).mean(axis=0))
    print("geometric means:", ", ".join(f"{mean:.3f}" for mean in means))


if __name__ == "__main__":
    main()
