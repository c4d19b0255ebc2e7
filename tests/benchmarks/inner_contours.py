"""Inner contours: what the labelling would gain from the true occluding contours inside the silhouette.

    python -m tests.benchmarks.inner_contours [SHAPE ...] [--seed 5] [--folder DIR]

Of each capture it prints the squared errors of the normals (observed pixels / whole mask) without contours, with those
that labels tell, and with a field that is cut along the true contours; cut there, with normals of the occluding contour
on the near side; cut beside the true contours, along a part of them, and along false ones as well. A shape that is not
a preset has 1,500 frames and 0.8 of its size.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, reconstruct_normals, settle
from glint.tasks.algorithms.labelling.weights import DEFAULT_FIELD, DEFAULT_OPTIONS, LabellingOptions
from glint.tasks.algorithms.prior.cut_field import cut_field
from tests.benchmarks.overlapping_limbs import MIN_STEP_PX, figurines, rises_and_steps
from tests.benchmarks.picture_edges import contour_pixels
from tests.benchmarks.simulated_captures import shapes_parser
from tests.benchmarks.true_view import TrueView

DISPLACED_PX = (1, 2)
"""Displacements to the right and down of contours that are not known to a pixel."""
MISSING_SHARES, PIECES_PX = (0.2, 0.4), 3.0
"""Shares of the contour pixels that are missing, and the standard deviation of the noise that chooses the pieces."""
TRUE_CONTOURS_ALONE = LabellingOptions(inner_contours=False)
"""Without the contours that labels tell."""


@dataclass(frozen=True, slots=True)
class Contours:
    """Occluding contours between pixels.

    right (H, W) bool: whether one runs between a pixel and its right neighbour; down (H, W) bool: and the one below.
    near (H, W) bool: pixels before a contour. outward (H, W, 3): their normals in the image plane.
    """

    right: np.ndarray
    down: np.ndarray
    near: np.ndarray
    outward: np.ndarray

    @classmethod
    def of(cls, depth: np.ndarray) -> "Contours":
        """Return the contours of a depth map (H, W), towards the camera, NaN outside the mask."""
        near, across = contour_pixels(depth, MIN_STEP_PX)
        _, right = rises_and_steps(depth, MIN_STEP_PX)
        _, down = rises_and_steps(depth.T, MIN_STEP_PX)
        outward = np.stack([across[..., 1], -across[..., 0], np.zeros(depth.shape)], axis=-1)
        return cls(np.pad(right, ((0, 0), (0, 1))), np.pad(down.T, ((0, 1), (0, 0))), near, outward)

    def displaced(self, pixels: int) -> "Contours":
        """Return them so many pixels farther to the right and down."""
        parts = self.right, self.down, self.near, self.outward
        return Contours(*(np.roll(part, (pixels, pixels), axis=(0, 1)) for part in parts))

    def without(self, share: float) -> "Contours":
        """Return them with pieces missing that make up this share of their pixels."""
        noise = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=self.near.shape), PIECES_PX)
        kept = self.near & (noise > np.quantile(noise[self.near], share))
        right = self.right & (kept | np.roll(kept, -1, axis=1))
        down = self.down & (kept | np.roll(kept, -1, axis=0))
        return Contours(right, down, kept, self.outward)

    def mirrored(self) -> "Contours":
        """Return their mirror image, left and right exchanged: as many contours in wrong places."""
        right, outward = np.roll(self.right[:, ::-1], -1, axis=1), self.outward[:, ::-1] * [-1.0, 1.0, 1.0]
        return Contours(right, self.down[:, ::-1], self.near[:, ::-1], outward)

    def with_mirrored(self) -> "Contours":
        """Return them together with their mirror image, which holds as many false ones."""
        false = self.mirrored()
        return Contours(self.right | false.right, self.down | false.down, self.near, self.outward)


def normals_with(clusters: Clusters, mask: np.ndarray, contours: Contours, has_rim: bool) -> np.ndarray:
    """Return the normals (H, W, 3) of a view labelled with a field that is cut along contours.

    has_rim: whether normals of the occluding contour hold on the near sides.
    """
    state = settle(clusters, mask, LabellingOptions(max_iterations=0))
    view = state.view
    surface = cut_field(mask, contours.right, contours.down, DEFAULT_FIELD.tension_length)
    state.view = replace(view, surface=surface, coarse=surface)
    if has_rim:
        inner = contours.near & mask & ~view.rim
        outward = np.where(inner[..., None], contours.outward, view.outward).astype(np.float32)
        state.view = replace(state.view, outward=outward, rim=view.rim | inner)
    state.smooth = state.initial = state.solve_field(state.known, state.values)
    state.iterate(DEFAULT_OPTIONS.max_iterations)
    state.options = TRUE_CONTOURS_ALONE
    return conclude(explain(state)).normals


def measure(capture: Capture, store: Path) -> Iterator[str]:
    """Yield lines on one capture, whose results are kept in a store."""
    view = TrueView.of(capture, store)
    exact = Contours.of(view.depth)

    def cut(contours: Contours, has_rim: bool = False) -> str:
        return view.errors(normals_with(view.clusters, view.mask, contours, has_rim))

    without = reconstruct_normals(view.clusters, view.mask, TRUE_CONTOURS_ALONE).normals
    yield f"without contours: {view.errors(without)}"
    yield f"with those that labels tell: {view.errors(reconstruct_normals(view.clusters, view.mask).normals)}"
    if not exact.near.any():
        return
    yield f"cut: {cut(exact)}"
    yield f"cut, with normals of the contour: {cut(exact, has_rim=True)}"
    for pixels in DISPLACED_PX:
        yield f"cut {pixels} px beside: {cut(exact.displaced(pixels))}"
    for share in MISSING_SHARES:
        yield f"cut, {share:.0%} missing: {cut(exact.without(share))}"
    yield f"cut, with as many false ones: {cut(exact.with_mirrored())}"


def main() -> None:
    """Print the lines of each capture as they are measured."""
    arguments = shapes_parser(__doc__, seed=5).parse_args()
    for name, capture, store in figurines(arguments.shapes, arguments.folder, arguments.seed):
        for line in measure(capture, store):
            print(f"{name}, {line}", flush=True)


if __name__ == "__main__":
    main()
