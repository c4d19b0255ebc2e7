"""Smooth normal field between known normals: a thin-plate interpolant under tension (Terzopoulos 1988).

It replaces the Markov random field of section 4.1 of Yeung et al. 2009. The field is solved for (n_x, n_y), not for
gradients: both are finite on the occluding contour, and on a sphere, or across a cylinder that is seen from the side,
they are linear in the image, so a thin plate under slight tension interpolates and extrapolates them well. Lengths are
measured in the silhouette's inradius, so the plate does not depend on the camera's resolution; but each pixel's normal
has a weight of its own, so a finer picture is followed more closely.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numba import njit
from scipy import ndimage

from glint.tasks.algorithms.geometry.banded_cholesky import solve_positive_definite
from glint.tasks.algorithms.geometry.bilinear_grid import BilinearGrid
from glint.tasks.algorithms.geometry.contours import outermost_pixels
from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside, inradius_of

MAX_NODES = 30_000
"""Grid nodes of the solve; larger regions get one node for several pixels, which bounds time and memory."""
CONTOUR_BLUR_PX = 2.0
"""Standard deviation in pixels of the smoothing of the mask's staircase."""
THICKNESS_LEVELS = 12
"""Number of radii to which the local thickness is rounded down."""
MIN_DIAGONAL = 1e-9
"""Added to the matrix's diagonal, so that components without any known normal stay solvable."""

Stencil = tuple[tuple[int, int, float], ...]
"""Finite difference: row offset, column offset and coefficient of each node."""
SLOPES: tuple[Stencil, ...] = (((0, 0, -1.0), (0, 1, 1.0)), ((0, 0, -1.0), (1, 0, 1.0)))
"""Differences whose squares are the membrane's energy |grad n|^2."""
CURVATURES: tuple[Stencil, ...] = (
    ((0, -1, 1.0), (0, 0, -2.0), (0, 1, 1.0)),
    ((-1, 0, 1.0), (0, 0, -2.0), (1, 0, 1.0)),
    ((0, 0, 2**0.5), (0, 1, -(2**0.5)), (1, 0, -(2**0.5)), (1, 1, 2**0.5)),
)
"""Differences whose squares are the plate's energy n_xx^2 + n_yy^2 + 2 n_xy^2, on a grid of step 1."""


def contour_normals(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of the occluding contour and their outward normals in the image plane.

    Where the mask runs into the region's border it is cut off, and has no contour; nor has it so near that the blur
    would reach the cut.

    mask: (H, W) bool.

    Returns:
        contour (H, W) bool; normals (H, W, 3) float32 with n_z = 0, NaN off the contour.
    """
    contour = outermost_pixels(mask)
    cut = np.zeros_like(mask)
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        cut[edge] = mask[edge]
    if cut.any():
        contour &= distance_inside(~cut) > 2 * CONTOUR_BLUR_PX
    smooth = ndimage.gaussian_filter(mask.astype(np.float32), CONTOUR_BLUR_PX, mode="nearest")
    # Padded, so that a region may be one pixel wide.
    down, right = (slope[1:-1, 1:-1] for slope in np.gradient(np.pad(smooth, 1, mode="edge")))
    normals = np.stack([-right, down, np.zeros_like(right)], axis=-1)
    length = np.linalg.norm(normals, axis=-1)
    contour &= length > 1e-6
    normals = np.where(contour[..., None], normals / np.maximum(length, 1e-6)[..., None], np.nan)
    return contour, normals.astype(np.float32)


@dataclass(frozen=True, slots=True)
class SmoothNormalField:
    """Interpolant of normals over a mask; built once, solved for changing constraints.

    grid: nodes of the interpolant. smoothness: (nodes, nodes), quadratic form of plate and tension.
    """

    grid: BilinearGrid
    smoothness: sparse.csc_matrix

    def solve(self, normals: np.ndarray, weights: np.ndarray, base: np.ndarray | None = None) -> np.ndarray:
        """Return the field that minimizes smoothness + sum of w |(n_x, n_y) - target|^2.

        Args:
            normals: (H, W, 3), the targets, read only where the weight is positive.
            weights: (H, W).
            base: (H, W, 3), finite in the mask: expected normals, creases included; the smooth part is the deviation.

        Returns:
            Unit normals (H, W, 3) float32, n_z >= 0, NaN outside the mask.
        """
        expected = None if base is None else base[..., :2].astype(float)
        target = normals[..., :2] if expected is None else normals[..., :2] - expected
        matrix, sums = self.grid.normal_equations(target, weights)
        matrix = (self.smoothness + matrix + MIN_DIAGONAL * sparse.identity(matrix.shape[0])).tocsr()
        plane = self.grid.interpolate(solve_positive_definite(matrix, sums))
        if expected is not None:
            plane += expected
        result = np.full((*plane.shape[:2], 3), np.nan, np.float32)
        _lift(plane, self.grid.mask, result)
        return result


@njit(cache=True, nogil=True)
def _lift(plane: np.ndarray, mask: np.ndarray, normals: np.ndarray) -> None:
    """Write the unit normals of (n_x, n_y) (H, W, 2) inside the mask to `normals` (H, W, 3)."""
    for y in range(mask.shape[0]):
        for x in range(mask.shape[1]):
            if mask[y, x]:
                # Where the plate leaves the unit disc, the normal lies in the image plane.
                length = max(np.sqrt(plane[y, x, 0] ** 2 + plane[y, x, 1] ** 2), 1.0)
                nx, ny = plane[y, x, 0] / length, plane[y, x, 1] / length
                normals[y, x, 0], normals[y, x, 1] = nx, ny
                normals[y, x, 2] = np.sqrt(max(1.0 - nx * nx - ny * ny, 0.0))


def smooth_normal_field(
    mask: np.ndarray, tension_length: float = 0.12, max_nodes: int = MAX_NODES
) -> SmoothNormalField:
    """Prepare the interpolant of a mask.

    Args:
        mask: (H, W) bool.
        tension_length: distance in inradii from any constraint beyond which the plate acts as a membrane, which does
            not overshoot.
        max_nodes: of the grid.
    """
    step = max(1, int(np.ceil(np.sqrt(mask.sum() / max_nodes))))
    grid = BilinearGrid.over(mask, step)
    tension = 1.0 / max(tension_length * inradius_of(mask), 1.0) ** 2
    smoothness = sum(tension * quadratic_form(grid.nodes, stencil) for stencil in SLOPES)
    smoothness = smoothness + sum(quadratic_form(grid.nodes, stencil) for stencil in CURVATURES) / step**2
    return SmoothNormalField(grid, smoothness.tocsc())


@dataclass(frozen=True, slots=True)
class ContourField:
    """Field between known normals and the occluding contour.

    surface: interpolant of the mask. rim (H, W) bool and outward (H, W, 3): contour and its normals. known_weight,
    rim_weight: of a known normal and of a pixel of the contour.
    """

    surface: SmoothNormalField
    rim: np.ndarray
    outward: np.ndarray
    known_weight: float
    rim_weight: float

    @classmethod
    def of(
        cls,
        mask: np.ndarray,
        tension_length: float,
        known_weight: float,
        rim_weight: float,
        max_nodes: int = MAX_NODES,
    ) -> "ContourField":
        """Prepare the field of a mask (H, W) bool; tension_length, max_nodes: see `smooth_normal_field`."""
        surface = smooth_normal_field(mask, tension_length, max_nodes)
        return cls(surface, *contour_normals(mask), known_weight, rim_weight)

    def solve(self, known: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the field (H, W, 3) by normals (H, W, 3) at `known` pixels (H, W) bool and the contour elsewhere."""
        weights = np.where(known, self.known_weight, np.where(self.rim, self.rim_weight, 0.0))
        return self.surface.solve(np.where(known[..., None], normals, self.outward), weights)


def quadratic_form(nodes: np.ndarray, stencil: Stencil, allowed: np.ndarray | bool = True) -> sparse.csr_matrix:
    """Return the sum of squares of a finite difference, taken wherever all its nodes exist: free boundaries.

    nodes: (rows, columns), their numbers from 0, -1 without one. allowed: (rows, columns) bool, where else it may be
    taken.
    """
    ends = [moved(nodes, row, column, -1) for row, column, _ in stencil]
    complete = np.all([end >= 0 for end in ends], axis=0) & allowed
    count = int(complete.sum())
    values = np.repeat([value for *_, value in stencil], count)
    entries = (np.tile(np.arange(count), len(stencil)), np.concatenate([end[complete] for end in ends]))
    difference = sparse.csr_matrix((values, entries), shape=(count, int(nodes.max()) + 1))
    return difference.T @ difference


def moved(values: np.ndarray, down: int, right: int, fill: int) -> np.ndarray:
    """Return values (rows, columns) of which each is the one that lies `down` below and `right` of it, -1 to 1 each.

    fill: the value beyond the border.
    """
    padded = np.pad(values, 1, constant_values=fill)
    return padded[1 + down : 1 + down + values.shape[0], 1 + right : 1 + right + values.shape[1]]


def thickness(mask: np.ndarray) -> np.ndarray:
    """Return the local thickness (H, W): radius in pixels of the largest circle inside the mask that covers a pixel.

    (Hildebrand and Ruegsegger 1997.) It is rounded down to one of THICKNESS_LEVELS radii. A fin is thin, and turns to
    its contour within a few pixels whatever the size of the body.
    """
    depth = depth_inside(mask)
    result = np.ones(mask.shape)
    for radius in np.geomspace(2.0, max(2.0, depth.max()), THICKNESS_LEVELS):
        core = depth >= radius
        if core.any():
            result[distance_inside(~core) <= radius] = radius
    return result
