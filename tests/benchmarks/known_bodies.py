"""Depth of vessels without and with the body that the labels found, and with bodies that are wrong.

    python -m tests.benchmarks.known_bodies [SHAPE ...] [--seed 71] [--focal 2.5] [--forced]

Of each capture it prints the share of the mask that follows the body, the mean error of the depth in pixels without and
with it, whether the depth follows it, and the same of bodies that are wrong: half as deep, at another tilt, moved along
the image. With `--forced` a body is accepted although the normals do not fit it.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.evaluation.metrics import depth_errors
from glint.tasks.algorithms.geometry.perspective import areal_focal_length
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.integration.contour_margin import with_margin
from glint.tasks.algorithms.revolution import symmetry
from glint.tasks.algorithms.revolution.symmetry import FitLimits
from glint.tasks.algorithms.vessels import body_normals
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.simulation.simulate import CaptureOptions
from glint.tasks.stages.depth import NORMAL_WEIGHT_POWER
from glint.tasks.stages.labels import load_view, reconstruct
from tests.benchmarks.simulated_captures import shapes_parser, simulated_captures
from tests.tasks.make_context import perform_all

VESSELS = ("goblet", "tumbler", "pitcher", "tankard", "coupe", "cut-bowl", "hobnail-vase", "mug", "wine-glass")
FOUND = symmetry.surface_of_revolution_normals
TILT_DEG, MOVED_PX = 5.0, 8
"""Tilt by which a wrong body is turned, and pixels by which one is moved."""


def forced_body(
    silhouette: symmetry.SilhouetteSymmetry, accepted: np.ndarray, candidates: np.ndarray, *_: Any
) -> symmetry.RotationalNormals | None:
    """Return the surface of revolution that fits best, however badly."""
    return FOUND(silhouette, accepted, candidates, limits=FitLimits(90.0, np.inf))


def wrong_bodies(body: np.ndarray) -> dict[str, np.ndarray]:
    """Return depths (H, W) that contradict the normals, of the right one (H, W; NaN where there is none)."""
    rows = np.indices(body.shape)[0]
    return {
        "half as deep": 0.5 * body,
        "tilted": body - np.tan(np.radians(TILT_DEG)) * rows,
        "moved": np.roll(body, MOVED_PX, axis=0),
    }


def measure(capture: Capture, store: Path, forced: bool) -> str:
    """Return a line on one capture, whose results are kept in a store."""
    work = CaptureContext(str(store), "object", capture, Parameters(), "known bodies")
    perform_all(work, "clusters")
    view, parameters = replace(load_view(work), marks=None), Parameters()
    mask = view.mask
    assert capture.truth is not None
    truth = read_truth(capture.truth, mask.shape).depth
    assert truth is not None
    with patch.object(body_normals, "surface_of_revolution_normals", forced_body if forced else FOUND):
        result = reconstruct(view, parameters.labels, parameters.silhouette)
    camera = view.camera
    distance = 1.0 if camera is None else areal_focal_length(camera)

    def error(body: np.ndarray | None) -> tuple[str, bool]:
        weight = result.confidence**NORMAL_WEIGHT_POWER
        depth = integrate(result.normals, mask, confidence=weight, camera=camera, body=body)
        errors = depth_errors(with_margin(depth.height(distance), mask)[0], truth, mask)
        return f"{errors.mean:.2f}", depth.follows_body

    alone, _ = error(None)
    if result.body_depth is None:
        return f"no body, {alone}"
    figure, follows = error(result.body_depth)
    wrong = {name: error(body) for name, body in wrong_bodies(result.body_depth).items()}
    share = np.isfinite(result.body_depth)[mask].mean()
    lines = ", ".join(
        f"{name} {value} ({'followed' if is_followed else 'not'})" for name, (value, is_followed) in wrong.items()
    )
    return f"{share:.0%} of the mask, {alone} -> {figure} ({'followed' if follows else 'not'}); wrong: {lines}"


def main() -> None:
    """Print a line per capture as it is measured."""
    parser = shapes_parser(__doc__, scale=0.6, frames=900, seed=71)
    parser.add_argument("--focal", type=float, help="of a perspective camera, in frame widths")
    parser.add_argument("--forced", action="store_true", help="accept a body although normals do not fit it")
    arguments = parser.parse_args()
    options = CaptureOptions(seed=arguments.seed, scale=arguments.scale, frames=arguments.frames, focal=arguments.focal)
    for name, capture, store in simulated_captures(arguments.shapes or VESSELS, arguments.folder, options):
        print(f"{name}: {measure(capture, store, arguments.forced)}", flush=True)


if __name__ == "__main__":
    main()
