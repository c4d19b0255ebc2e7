"""Flat faces: errors with and without the hypothesis, on solids of flat faces and on curved ones that have none.

    python -m tests.benchmarks.flat_faces [SHAPE ...] [--views 3] [--seed 5] [--folder DIR]

Each shape is simulated from several sides. Of each side it prints the squared errors of the normals (observed pixels /
whole mask), the share of the mask at confidence 0.95 and of these the share within 5 degrees, without flat faces and
with them.
"""

from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.geometry.perspective import rotate_to_view
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.confidence import with_input_doubt
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.results import CONFIDENT, Reconstruction
from glint.tasks.algorithms.labelling.weights import DEFAULT_OPTIONS
from glint.tasks.evaluation.captures import CONFIDENT_ERROR_DEG
from glint.tasks.simulation.simulate import CaptureOptions
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import faced
from tests.benchmarks.simulated_captures import shapes_parser, simulated_captures
from tests.benchmarks.true_view import TrueView

FACETED = ("hexagonal-prism", "cut-cube", "gem", "faceted-bottle")


def measure(capture: Capture, store: Path, hypothesis: str = "flat_faces") -> str:
    """Return a line on one capture, whose results are kept in a store: without a hypothesis, and with it.

    hypothesis: `flat_faces` or `symmetry`.
    """
    known_view = TrueView.of(capture, store)
    work, mask, geometry = known_view.work, known_view.mask, load_geometry(known_view.work)
    camera, view = geometry.region_camera, geometry.view_vectors
    clusters, truth = faced(known_view.clusters, view), rotate_to_view(known_view.normals, view)
    settled = settle(clusters, mask, camera=camera)
    shared_sd = work.load("lights").read("half_vector_sd")

    def errors(result: Reconstruction) -> str:
        squared = ((result.normals - truth) ** 2).sum(axis=-1)
        known = mask & np.isfinite(squared)
        confidence = with_input_doubt(result.confidence, shared_sd, np.zeros(mask.shape))
        confident = known & (confidence >= CONFIDENT)
        right = angles(result.normals, truth)[confident] < CONFIDENT_ERROR_DEG
        pair = f"{squared[known & (clusters.observations > 0)].mean():.4f} / {squared[known].mean():.4f}"
        return f"{pair}, {confident.sum() / known.sum():.0%}, {right.mean() if right.size else np.nan:.1%} right"

    switched_off: dict[str, Any] = {hypothesis: False}
    without = copy(settled)
    without.options = replace(DEFAULT_OPTIONS, **switched_off)
    return f"without {errors(conclude(explain(without)))}; with {errors(conclude(explain(settled)))}"


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, views=3, seed=5, frames=1500, scale=0.8).parse_args()
    options = CaptureOptions(frames=arguments.frames, scale=arguments.scale, seed=arguments.seed, views=arguments.views)
    for name, capture, store in simulated_captures(arguments.shapes or FACETED, arguments.folder, options):
        print(f"{name}: {measure(capture, store)}", flush=True)


if __name__ == "__main__":
    main()
