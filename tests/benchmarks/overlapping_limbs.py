"""Overlapping limbs: how much of the error of figurines lies beside contours and creases inside their silhouettes.

    python -m tests.benchmarks.overlapping_limbs [SHAPE ...] [--views 1] [--seed 5] [--folder DIR]

Of each capture it prints the squared errors of the normals (observed pixels / whole mask) without normals of dark
pixels and contours inside the silhouette, with the former, and with both; the share of confident pixels, and how many
of them are within 5 degrees; and for two kinds of true curves inside the silhouette, occluding contours alone and all
curves across which the normal turns, the share of the mask within 0.2 inradii of one, and the share of the squared
error there. A shape that is not a preset has 1,500 frames and 0.8 of its size.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.weights import DEFAULT_OPTIONS, FieldWeights, LabellingOptions
from glint.tasks.simulation.simulate import PRESETS, CaptureOptions
from tests.benchmarks.simulated_captures import shapes_parser, simulated_captures
from tests.benchmarks.true_view import TrueView

FIGURINES = ("puppy", "elephant", "teddy-bear", "bird")
NEAR_INRADII = 0.2
"""Distance to a curve up to which a pixel lies beside it."""
MIN_STEP_PX, MIN_STEP_RATIO, MAX_FAR_SLOPE = 3.0, 1.3, 3.0
"""A depth step exceeds this many pixels and this many times the slopes beside it, that of the far side being limited:
the near surface curves away with a slope that grows towards its contour without bound."""
TOLERANCE = float(4.0 * np.sin(np.radians(2.5)) ** 2)
"""Squared error of a normal that is 5 degrees off."""
MIN_TURN_DEG = 25.0
"""Angle between the normals of neighbouring pixels from which a curve runs between them."""


def depth_steps(depth: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool on either side of a depth step to the right neighbour.

    depth: (H, W), towards the camera, NaN outside the mask.
    """
    _, is_step = rises_and_steps(depth, MIN_STEP_PX)
    return np.pad(is_step, ((0, 0), (0, 1))) | np.pad(is_step, ((0, 0), (1, 0)))


def rises_and_steps(depth: np.ndarray, min_step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rises (H, W - 1) from each pixel to its right neighbour, and which of them (H, W - 1) bool are steps.

    depth: likewise; min_step: rise beyond the slopes beside it from which it is a step, pixels.
    """
    rise = np.diff(depth, axis=1)
    # Where there is no further neighbour, the slope counts as zero.
    before = np.nan_to_num(np.abs(np.pad(rise, ((0, 0), (1, 0)))[:, :-1]))
    after = np.nan_to_num(np.abs(np.pad(rise, ((0, 0), (0, 1)))[:, 1:]))
    near, far = np.where(rise > 0, after, before), np.where(rise > 0, before, after)
    with np.errstate(invalid="ignore"):
        return rise, np.abs(rise) > min_step + MIN_STEP_RATIO * (near + np.minimum(far, MAX_FAR_SLOPE))


def turns(normals: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool whose normal differs much from that of the right neighbour; normals (H, W, 3)."""
    turn = np.nan_to_num(angles(normals[:, 1:], normals[:, :-1])) > MIN_TURN_DEG
    return np.pad(turn, ((0, 0), (0, 1))) | np.pad(turn, ((0, 0), (1, 0)))


def measure(capture: Capture, store: Path) -> str:
    """Return a line on one capture, whose results are kept in a store."""
    view = TrueView.of(capture, store)
    uncut = LabellingOptions(inner_contours=False)
    unbent = replace(uncut, field=FieldWeights(unreached=0.0))
    results = [reconstruct_normals(view.clusters, view.mask, options) for options in (unbent, uncut, DEFAULT_OPTIONS)]
    result = results[-1]
    squared = ((result.normals - view.normals) ** 2).sum(axis=-1)
    known = view.mask & np.isfinite(squared)
    steps = depth_steps(view.depth) | depth_steps(view.depth.T).T
    turning = steps | turns(view.normals) | turns(view.normals.swapaxes(0, 1)).T

    def shares(curves: np.ndarray) -> str:
        if not curves.any():
            return "0% of the mask with 0%"
        near = ndimage.distance_transform_edt(~curves) <= NEAR_INRADII * inradius_of(view.mask)
        return f"{near[known].mean():.0%} of the mask with {squared[known & near].sum() / squared[known].sum():.0%}"

    confident = known & (result.confidence >= 0.95)
    share = f"{confident.sum() / known.sum():.0%} confident, {(squared[confident] < TOLERANCE).mean():.1%} right"
    near = f"beside contours {shares(steps)} of the error; beside all curves {shares(turning)}"
    errors = " -> ".join(view.errors(labelled.normals) for labelled in results)
    return f"{errors}, {share}; {near}"


def figurines(
    shapes: Sequence[str], folder: Path | None, seed: int, views: int = 1
) -> Iterator[tuple[str, Capture, Path]]:
    """Yield what `simulated_captures` does of shapes, of FIGURINES if there are none: presets in their size."""
    for shape in shapes or FIGURINES:
        smaller = CaptureOptions(seed=seed, views=views, frames=1500, scale=0.8)
        options = CaptureOptions(seed=seed, views=views) if shape in PRESETS else smaller
        yield from simulated_captures([shape], folder, options)


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, views=1, seed=5).parse_args()
    for name, capture, store in figurines(arguments.shapes, arguments.folder, arguments.seed, arguments.views):
        print(f"{name}: {measure(capture, store)}", flush=True)


if __name__ == "__main__":
    main()
