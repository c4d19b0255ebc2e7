"""Near cameras without their matrix, with one sphere: what the object's normals measure, against the truth.

    python -m tests.benchmarks.near_camera [--seed S] [--folder DIR] [SHAPE ..]

Simulates every shape (half the size, 600 frames) from afar and at focal lengths of 2.4, 1.5 and 0.9 frame widths, takes
the matrix from the catalogue, and prints the inverse focal length per frame width, its standard deviation, and of the
mask's pixels the share that is confident and of these the share within 5 degrees. Takes about half an hour.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import load
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT, exterior_normals
from glint.tasks.algorithms.near_light.focal_length_of_normals import focal_length_of_normals
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.evaluation.captures import CONFIDENT_ERROR_DEG
from glint.tasks.simulation.simulate import SHAPES, CaptureOptions, simulate
from glint.tasks.stages.camera_doubt import unknown_camera
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import load_clusters
from tests.tasks.make_context import perform_all

FOCAL_WIDTHS = (None, 2.4, 1.5, 0.9)


def measure(shape: str, focal: float | None, folder: Path, seed: int) -> str:
    """Return a line: what the normals of a simulated capture measure, and what becomes of the confidence."""
    options = CaptureOptions(frames=600, scale=0.5, seed=seed, focal=focal)
    capture = load(simulate(shape, folder / f"{shape}-{focal}", options).catalogue).objects[0].captures[0]
    entry = capture.model_copy(update={"camera": None})
    work = CaptureContext(str(folder / f"store-{shape}-{focal}"), shape, entry, Parameters(), "benchmark")
    records = perform_all(work, "labels")
    geometry, saved, mask = load_geometry(work), work.load("labels"), work.load("mask").read("mask")
    width = geometry.frame_size[0]
    normals = exterior_normals(load_clusters(work).normals, saved.read("labels"))
    estimate = focal_length_of_normals(normals, unknown_camera(geometry))
    assert capture.truth is not None
    truth = read_truth(capture.truth, mask.shape).normals
    assert truth is not None
    error, is_confident = angles(saved.read("normals"), truth), mask & (saved.read("confidence") >= CONFIDENT)
    right = float((error[is_confident] < CONFIDENT_ERROR_DEG).mean()) if is_confident.any() else float("nan")
    measured = "none" if estimate is None else f"{estimate.value * width:+.2f} +- {estimate.deviation * width:.2f}"
    causes = {warning.cause for record in records for warning in record.warnings}
    return (
        f"{shape}: inverse focal length {0.0 if focal is None else 1.0 / focal:.2f}, measured {measured}; mean error"
        f" {np.nanmean(error[mask]):.1f} degrees, {is_confident.sum() / mask.sum():.0%} confident, {right:.0%} right;"
        f" warnings: {', '.join(sorted(causes)) or 'none'}"
    )


def main() -> None:
    """Print a line per capture as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", metavar="SHAPE")
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--folder", type=Path, help="folder for captures and stores; a temporary one by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        for shape in options.shapes or SHAPES:
            for focal in FOCAL_WIDTHS:
                print(measure(shape, focal, options.folder or Path(temporary), options.seed), flush=True)


if __name__ == "__main__":
    main()
