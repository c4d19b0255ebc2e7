"""Picture edges: whether occluding contours inside the silhouette show in the pictures of a recording.

    python -m tests.benchmarks.picture_edges CATALOGUE STORE [--only OBJECT]...

Of each capture that was run into the store and has a true depth, it prints the share of the pixels before a true depth
step that lie within one and two pixels of an edge, beside the same share of all pixels inside the silhouette (chance),
for the strongest edges of all pictures together: median, mean, maximum, upper decile and deviation over time. An edge
is a pixel whose gradient is the largest along its direction; so many are kept that they cover 20, 10 and 5% of the
object. Last the share of contour pixels whose strongest edge within four pixels across the contour is at most one pixel
from it.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import load
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.frames import open_frames
from tests.benchmarks.overlapping_limbs import rises_and_steps

MIN_STEP_PX = 1.2
"""Depth step beyond the slopes beside it, pixels: lower than that of limbs, so that low reliefs count."""
BLUR_PX = 1.0
"""Standard deviation of the derivatives of a Gaussian that measure gradients."""
INSIDE_PX = 2
"""Distance from the silhouette below which an edge is the silhouette's own."""
ACROSS_PX = 4.0
"""Distance up to which the strongest edge across a contour is looked for."""
COVERS = (0.2, 0.1, 0.05)
"""Shares of the object's pixels that edges cover."""
SAMPLED = 500
"""Frames of which the pictures are made."""


def joint_gradient(frames: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the length (H, W) of the joint gradient of all pictures of frames (T, H, W), and its angle in radians.

    It is that of Di Zenzo (1986): the largest eigenvalue of the sum of structure tensors, each picture having unit
    deviation in the mask (H, W) bool.
    """
    pictures = [np.median(frames, axis=0), frames.mean(axis=0), frames.max(axis=0), frames.std(axis=0)]
    pictures.append(np.quantile(frames, 0.9, axis=0))
    tensor = np.zeros((3, *mask.shape))
    for levels in pictures:
        picture = np.sqrt(levels)
        picture = picture / max(picture[mask].std(), 1e-6)
        right, down = (ndimage.gaussian_filter(picture, BLUR_PX, order=order) for order in ((0, 1), (1, 0)))
        tensor += np.stack([right * right, right * down, down * down])
    half = (tensor[0] - tensor[2]) / 2.0
    largest = (tensor[0] + tensor[2]) / 2.0 + np.hypot(half, tensor[1])
    return np.sqrt(largest), 0.5 * np.arctan2(2.0 * tensor[1], 2.0 * half)


def ridges(gradient: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool whose gradient is the largest along its direction."""
    rows, columns = np.indices(gradient.shape).astype(float)
    down, right = np.sin(angle), np.cos(angle)
    ahead, behind = (
        ndimage.map_coordinates(gradient, [rows + sign * down, columns + sign * right], order=1) for sign in (1, -1)
    )
    return np.asarray((gradient >= ahead) & (gradient > behind))


def contour_pixels(depth: np.ndarray, min_step: float = MIN_STEP_PX) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (H, W) bool just before depth steps, and the directions (H, W, 2), row and column, across them.

    depth: (H, W), towards the camera, NaN outside the mask; min_step: see `rises_and_steps`, pixels.
    """
    near, across = np.zeros(depth.shape, bool), np.zeros((*depth.shape, 2))
    for axis in (0, 1):
        rise, steps = rises_and_steps(depth.swapaxes(axis, 1), min_step)
        falling = np.pad(steps & (rise < 0), ((0, 0), (0, 1))).swapaxes(axis, 1)
        rising = np.pad(steps & (rise > 0), ((0, 0), (1, 0))).swapaxes(axis, 1)
        near |= falling | rising
        across[..., axis] += falling * 1.0 - rising * 1.0
    smooth = np.stack([ndimage.gaussian_filter(across[..., axis], 2.0) for axis in (0, 1)], axis=-1)
    return near, smooth / np.maximum(np.linalg.norm(smooth, axis=-1, keepdims=True), 1e-9)


def sampled_frames(work: CaptureContext) -> np.ndarray:
    """Return some SAMPLED frames (T, H, W) float32 of a capture's object, evenly spaced."""
    cache = open_frames(work)
    return cache.read(OBJECT)[:: max(1, cache.frames // SAMPLED)].astype(np.float32)


def measure(work: CaptureContext) -> str:
    """Return a line on one stored capture."""
    assert work.capture.truth is not None
    mask = work.load("mask").read("mask")
    truth = read_truth(work.capture.truth, mask.shape)
    assert truth.depth is not None
    gradient, angle = joint_gradient(sampled_frames(work), mask)
    inside = ndimage.binary_erosion(mask, iterations=INSIDE_PX)
    near, across = contour_pixels(np.where(mask, truth.depth, np.nan))
    near &= inside
    if not near.any():
        return "no contours"
    edges = ridges(gradient, angle) & inside
    parts = []
    for cover in COVERS:
        least = np.sort(gradient[edges])[::-1][: int(cover * inside.sum())][-1]
        distance = ndimage.distance_transform_edt(~(edges & (gradient >= least)))
        shares = [(distance[where] <= limit).mean() for limit in (1.0, 2.0) for where in (near, inside)]
        parts.append(f"{cover:.0%}: {shares[0]:.0%} ({shares[1]:.0%}), {shares[2]:.0%} ({shares[3]:.0%})")
    offsets = np.arange(-ACROSS_PX, ACROSS_PX + 0.01, 0.25)
    rows, columns = np.nonzero(near)
    places = [index + offsets[:, None] * across[near][:, axis] for axis, index in enumerate((rows, columns))]
    strongest = offsets[ndimage.map_coordinates(gradient, places, order=1).argmax(axis=0)]
    snapped = (np.abs(strongest - 0.5) <= 1.0).mean()
    return (
        f"{near.sum()} contour pixels; within 1 and 2 px of an edge (chance), {'; '.join(parts)}; snapped {snapped:.0%}"
    )


def main() -> None:
    """Print a line per capture as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("store")
    parser.add_argument("--only", action="append", help="this object (repeatable)")
    options = parser.parse_args()
    for item in load(options.catalogue).objects:
        if options.only and item.id not in options.only:
            continue
        for capture in item.captures:
            work = CaptureContext(options.store, item.id, capture, Parameters(), "picture edges")
            print(f"{work.name}: {measure(work)}", flush=True)


if __name__ == "__main__":
    main()
