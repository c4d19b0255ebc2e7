"""What readmitted sheets are worth: the errors of stored candidates that are labelled again without and with them.

    python -m tests.benchmarks.readmission CATALOGUE STORE [--only OBJECT]...

The captures of CATALOGUE with a truth (or those of OBJECT) were run into STORE. Of each it prints the squared errors of
the normals (observed pixels / whole mask) without and with readmitted sheets, the change over the whole mask, and the
share of confident pixels in both, and how many of them are within 5 degrees; at last the geometric mean of the changes.
"""

import argparse

import numpy as np

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.candidates.shading import without_shading
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.perspective import rotate_to_view
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import faced, load_clusters


def measure(work: CaptureContext) -> tuple[str, float]:
    """Return a line on one capture, and the squared error with readmitted sheets relative to that without."""
    clusters, mask = without_shading(load_clusters(work)), work.load("mask").read("mask")
    view, truth = load_geometry(work).view_vectors, None
    if work.capture.truth is not None:
        truth = read_truth(work.capture.truth, mask.shape).normals
    assert truth is not None
    clusters, truth = faced(clusters, view), rotate_to_view(truth, view)
    observed, parts, errors = mask & (clusters.observations > 0), [], []
    for readmission in (False, True):
        result = reconstruct_normals(clusters, mask, LabellingOptions(readmission=readmission, inner_contours=False))
        confident = mask & (result.confidence >= CONFIDENT)
        right = (angles(result.normals, truth)[confident] < 5.0).mean() if confident.any() else np.nan
        errors.append(squared_errors(result.normals, truth, mask))
        pair = f"{squared_errors(result.normals, truth, observed):.4f} / {errors[-1]:.4f}"
        parts.append(f"{pair}, {confident.sum() / mask.sum():.0%} confident, {right:.1%} right")
    return f"{' -> '.join(parts)}; {errors[1] / errors[0] - 1.0:+.0%}", errors[1] / errors[0]


def main() -> None:
    """Print a line per capture as it is measured, then their mean."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue")
    parser.add_argument("store")
    parser.add_argument("--only", action="append", default=[], metavar="OBJECT")
    arguments = parser.parse_args()
    changes = []
    for object_id, captures in chosen_captures(load_catalogue(arguments.catalogue).objects, arguments.only).items():
        for capture_id in captures:
            reference = CaptureReference(arguments.catalogue, object_id, capture_id, arguments.store, "benchmark")
            line, change = measure(reference.context())
            changes.append(change)
            print(f"{object_id}/{capture_id}: {line}", flush=True)
    print(f"geometric mean: {np.exp(np.mean(np.log(changes))) - 1.0:+.1%}")


if __name__ == "__main__":
    main()
