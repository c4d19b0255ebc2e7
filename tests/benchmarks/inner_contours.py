"""Inner contours: what the labelling would gain from the true occluding contours inside the silhouette.

    python -m tests.benchmarks.inner_contours [SHAPE ...] [--seed 5] [--folder DIR]

Of each capture it prints the squared errors of the normals (observed pixels / whole mask) as they are, and with a field
that is cut along the true contours; cut there, with normals of the occluding contour on the near side; cut beside
the true contours, along a part of them, and along false ones as well. A shape that is not a preset has 1,500 frames and
0.8 of its size.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage, sparse

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.geometry.bilinear_grid import BilinearGrid
from glint.tasks.algorithms.geometry.distance import inradius
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals, settle
from glint.tasks.algorithms.labelling.weights import DEFAULT_FIELD, DEFAULT_OPTIONS, LabellingOptions
from glint.tasks.algorithms.prior.smooth_normals import SmoothNormalField
from tests.benchmarks.overlapping_limbs import MIN_STEP_PX, figurines, rises_and_steps
from tests.benchmarks.picture_edges import contour_pixels
from tests.benchmarks.simulated_captures import shapes_parser
from tests.benchmarks.true_view import TrueView

DISPLACED_PX = (1, 2)
"""Displacements to the right and down of contours that are not known to a pixel."""
MISSING_SHARES, PIECES_PX = (0.2, 0.4), 3.0
"""Shares of the contour pixels that are missing, and the standard deviation of the noise that chooses the pieces."""


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


def cut_field(mask: np.ndarray, contours: Contours, tension_length: float) -> SmoothNormalField:
    """Return the smooth field of a mask (H, W) bool, with a node for each pixel and no smoothness across contours."""
    grid = BilinearGrid.over(mask, 1)
    missing = [(0, grid.nodes.shape[axis] - mask.shape[axis]) for axis in (0, 1)]
    cuts = {(0, 1): np.pad(contours.right, missing), (1, 0): np.pad(contours.down, missing)}

    def form(*stencil: tuple[int, int, float]) -> sparse.csr_matrix:
        """Return the sum of squares of a difference wherever all its nodes exist and no edge between them is cut."""
        offsets = [(down, right) for down, right, _ in stencil]
        complete = np.all([_moved(grid.nodes, *offset, -1) >= 0 for offset in offsets], axis=0)
        for down, right in offsets:
            for (v, u), cut in cuts.items():
                if (down + v, right + u) in offsets:
                    complete &= ~_moved(cut, down, right, False)
        count = int(complete.sum())
        columns = np.concatenate([_moved(grid.nodes, *offset, -1)[complete] for offset in offsets])
        values = np.repeat([value for *_, value in stencil], count)
        rows = np.tile(np.arange(count), len(stencil))
        difference = sparse.csr_matrix((values, (rows, columns)), shape=(count, grid.count))
        return difference.T @ difference

    tension, mixed = 1.0 / max(tension_length * inradius(mask), 1.0) ** 2, 2.0**0.5
    smoothness = tension * (form((0, 0, -1.0), (0, 1, 1.0)) + form((0, 0, -1.0), (1, 0, 1.0)))
    smoothness = smoothness + form((0, -1, 1.0), (0, 0, -2.0), (0, 1, 1.0))
    smoothness = smoothness + form((-1, 0, 1.0), (0, 0, -2.0), (1, 0, 1.0))
    smoothness = smoothness + form((0, 0, mixed), (0, 1, -mixed), (1, 0, -mixed), (1, 1, mixed))
    return SmoothNormalField(grid, smoothness.tocsc())


def _moved(values: np.ndarray, down: int, right: int, fill: int) -> np.ndarray:
    """Return at each place the value (rows, columns) that lies so far below and to the right, at most a pixel."""
    padded = np.pad(values, 1, constant_values=fill)
    return padded[1 + down : 1 + down + values.shape[0], 1 + right : 1 + right + values.shape[1]]


def normals_with(clusters: Clusters, mask: np.ndarray, contours: Contours, has_rim: bool) -> np.ndarray:
    """Return the normals (H, W, 3) of a view labelled with a field that is cut along contours.

    has_rim: whether normals of the occluding contour hold on the near sides.
    """
    state = settle(clusters, mask, LabellingOptions(max_iterations=0))
    surface, view = cut_field(mask, contours, DEFAULT_FIELD.tension_length), state.view
    state.view = replace(view, surface=surface, coarse=surface)
    if has_rim:
        inner = contours.near & mask & ~view.rim
        outward = np.where(inner[..., None], contours.outward, view.outward).astype(np.float32)
        state.view = replace(state.view, outward=outward, rim=view.rim | inner)
    state.smooth = state.initial = state.solve_field(state.known, state.values)
    state.iterate(DEFAULT_OPTIONS.max_iterations)
    return reconstruct_normals(clusters, mask, settled=state).normals


def measure(capture: Capture, store: Path) -> Iterator[str]:
    """Yield lines on one capture, whose results are kept in a store."""
    view = TrueView.of(capture, store)
    exact = Contours.of(view.depth)

    def cut(contours: Contours, has_rim: bool = False) -> str:
        return view.errors(normals_with(view.clusters, view.mask, contours, has_rim))

    yield f"as it is: {view.errors(reconstruct_normals(view.clusters, view.mask).normals)}"
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
