"""The smooth field of normals between what is known: rim and accepted highlights (paper 4.1, METHOD 4).

The field is solved for (n_x, n_y), not for gradients: both are finite on the rim, and on a sphere or a cylinder they
are linear in the image, so a thin plate under slight tension interpolates and extrapolates them well. Lengths are
measured in the silhouette's inradius, so the result does not depend on the camera's resolution.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from scipy import ndimage
from scipy.sparse.linalg import splu

MAX_NODES = 30_000
"""Grid nodes of the solve; larger regions get one node for several pixels, which keeps time and memory linear."""


def rim_normals(mask: np.ndarray, blur: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Rim pixels and their outward normals in the image plane.

    mask (H, W) bool -> rim (H, W) bool, normals (H, W, 3) float32 with n_z = 0, NaN off the rim. `blur` is the
    standard deviation in pixels of the smoothing of the silhouette's staircase. Where the mask runs into the region's
    border its outline is a cut, not a contour: no rim there, nor so near that the blur would see the cut.
    """
    rim = mask & ~ndimage.binary_erosion(np.pad(mask, 1, mode="edge"))[1:-1, 1:-1]
    cut = np.zeros_like(mask)
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        cut[edge] = mask[edge]
    if cut.any():
        rim &= ndimage.distance_transform_edt(~cut) > 2 * blur
    smooth = ndimage.gaussian_filter(mask.astype(np.float32), blur, mode="nearest")
    down, right = np.gradient(smooth)
    normals = np.stack([-right, down, np.zeros_like(right)], axis=-1)
    length = np.linalg.norm(normals, axis=-1)
    rim &= length > 1e-6
    normals = np.where(rim[..., None], normals / np.maximum(length, 1e-6)[..., None], np.nan)
    return rim, normals.astype(np.float32)


def inradius(mask: np.ndarray) -> float:
    """Radius in pixels of the largest circle inside the mask (H, W): the object's scale in the image."""
    return float(ndimage.distance_transform_edt(np.pad(mask, 1)).max())


@dataclass(frozen=True, slots=True)
class SmoothField:
    """Interpolates normals over a mask; built once, solved for changing constraints.

    `sampling` (pixels, nodes) interpolates bilinearly from the grid; `smoothness` (nodes, nodes) is the quadratic
    form of plate and tension.
    """

    mask: np.ndarray
    sampling: sparse.csr_matrix
    smoothness: sparse.csc_matrix

    def solve(self, normals: np.ndarray, weights: np.ndarray, base: np.ndarray | None = None) -> np.ndarray:
        """The field that minimises smoothness plus sum of w |(n_x, n_y) - target|^2.

        normals (H, W, 3), read only where weights (H, W) > 0 -> unit normals (H, W, 3) float32, n_z >= 0, NaN outside.
        base (H, W, 3), finite in the mask: an expected field, creases and all; what departs from it is smooth.
        """
        weight = weights[self.mask].astype(float)
        expected = np.zeros((len(weight), 2)) if base is None else base[self.mask][:, :2].astype(float)
        target = np.where(weight[:, None] > 0, normals[self.mask][:, :2], expected) - expected
        matrix = self.smoothness + self.sampling.T @ sparse.diags(weight) @ self.sampling
        matrix = (matrix + 1e-9 * sparse.identity(matrix.shape[0])).tocsc()
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        plane = expected + self.sampling @ factor.solve(self.sampling.T @ (weight[:, None] * target))
        plane /= np.maximum(np.linalg.norm(plane, axis=-1, keepdims=True), 1.0)
        result = np.full((*self.mask.shape, 3), np.nan, np.float32)
        result[self.mask] = np.column_stack([plane, np.sqrt(np.maximum(1.0 - (plane**2).sum(axis=-1), 0.0))])
        return result


def smooth_field(mask: np.ndarray, tension_length: float = 0.12, max_nodes: int = MAX_NODES) -> SmoothField:
    """Prepare the field of a mask (H, W) bool.

    Beyond `tension_length` (in inradii) from any constraint the plate becomes a membrane, which does not overshoot.
    """
    step = max(1, int(np.ceil(np.sqrt(mask.sum() / max_nodes))))
    sampling, grid = _grid(mask, step)
    tension = 1.0 / max(tension_length * inradius(mask), 1.0) ** 2
    first = [[(0, 0, -1.0), (0, 1, 1.0)], [(0, 0, -1.0), (1, 0, 1.0)]]
    second = [[(0, -1, 1.0), (0, 0, -2.0), (0, 1, 1.0)], [(-1, 0, 1.0), (0, 0, -2.0), (1, 0, 1.0)]]
    twist = [(0, 0, 2**0.5), (0, 1, -(2**0.5)), (1, 0, -(2**0.5)), (1, 1, 2**0.5)]
    smoothness = sum(tension * _form(grid, stencil) for stencil in first)
    smoothness = smoothness + sum(_form(grid, stencil) for stencil in [*second, twist]) / step**2
    return SmoothField(mask, sampling, smoothness.tocsc())


def _grid(mask: np.ndarray, step: int) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Bilinear interpolation (pixels, nodes) from the nodes at every `step`-th pixel, and the grid of their numbers."""
    rows, columns = np.nonzero(mask)
    grid = np.full((mask.shape[0] // step + 2, mask.shape[1] // step + 2), -1)
    corners, weights = [], []
    for down in (0, 1):
        for right in (0, 1):
            weight = np.abs(1 - down - rows % step / step) * np.abs(1 - right - columns % step / step)
            corners.append((rows // step + down, columns // step + right))
            weights.append(weight)
            used = weight > 0
            grid[corners[-1][0][used], corners[-1][1][used]] = 0
    grid[grid == 0] = np.arange((grid == 0).sum())
    pixels = np.arange(len(rows))
    sampling = sparse.csr_matrix((len(rows), grid.max() + 1))
    for corner, weight in zip(corners, weights, strict=True):
        used = weight > 0
        part = (weight[used], (pixels[used], grid[corner][used]))
        sampling = sampling + sparse.csr_matrix(part, shape=sampling.shape)
    return sampling, grid


def _form(grid: np.ndarray, stencil: list[tuple[int, int, float]]) -> sparse.csr_matrix:
    """Quadratic form of a finite difference, taken wherever all its nodes exist: free boundaries."""
    height, width = grid.shape
    padded = np.pad(grid, 2, constant_values=-1)
    nodes = [padded[2 + dy : 2 + dy + height, 2 + dx : 2 + dx + width] for dy, dx, _ in stencil]
    whole = np.all([node >= 0 for node in nodes], axis=0)
    count = int(whole.sum())
    values = np.repeat([value for *_, value in stencil], count)
    places = (np.tile(np.arange(count), len(stencil)), np.concatenate([node[whole] for node in nodes]))
    difference = sparse.csr_matrix((values, places), shape=(count, int(grid.max()) + 1))
    return difference.T @ difference


def thickness(mask: np.ndarray, levels: int = 12) -> np.ndarray:
    """Radius (H, W) in pixels, in `levels` steps, of the largest circle inside the mask (H, W) that covers each pixel.

    A fin is thin and turns to its rim within a few pixels, whatever the size of the body.
    """
    depth = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    result = np.ones(mask.shape)
    for radius in np.geomspace(2.0, max(2.0, depth.max()), levels):
        core = depth >= radius
        if core.any():
            result[ndimage.distance_transform_edt(~core) <= radius] = radius
    return result


def field_spread(
    known: np.ndarray, scale: np.ndarray | float, near: float = 4.0, growth: float = 25.0, most: float = 30.0
) -> np.ndarray:
    """Standard deviation in radians (H, W) of the field: `near` degrees at a known pixel, `growth` more per `scale`.

    known (H, W) bool; scale: the object's thickness there in pixels, (H, W) or one for all. Never above `most` degrees:
    the field is smooth, not arbitrary.
    """
    if not known.any():
        return np.full(known.shape, np.radians(most))
    distance = ndimage.distance_transform_edt(~known)
    return np.asarray(np.radians(np.minimum(near + growth * distance / np.maximum(scale, 1.0), most)))
