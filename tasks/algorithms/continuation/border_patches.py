"""Border patches: how accepted normals continue beyond the border of their sheet.

On a sphere, and across a cylinder or cone whose axis lies in the image plane, (n_x, n_y) is linear in the image, up to
the occluding contour, where its length is 1. So what a limb looks like beyond the normals that the lights reach
follows from a linear fit to those beside it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.sheets.segments import segment_sheets

PATCH_SPACING_INRADII, PATCH_WINDOW_INRADII = 0.15, 0.25
"""Distance between the centres of patches of one border, and radius of the window of a fit, in inradii."""
MIN_RADII_PX = (2.0, 4.0)
"""Least such distance and radius."""
SHEET_TURN_DEG = 15.0
"""Angle between neighbouring normals of a sheet: small limbs turn by several degrees from pixel to pixel."""
MIN_SHEET, MIN_FIT = 12, 8
"""Pixels of a sheet that has patches, and of a fit."""
SLOPE_RIDGE = 0.002
"""Weight of a slope of zero, relative to the pixels of a fit: across a thin line of them nothing tells the slope."""
MIN_FIT_DEVIATION = 0.02
"""Least standard deviation of a pixel from a fit."""
FIT_SHAPES: tuple[tuple[int, ...], ...] = ((2,), (2,), (2, 2), (), (3, 3))
"""Shapes of the parts of a fit."""
CORRELATED_PX = 9.0
"""Pixels that share one error: neighbouring highlights are of the same frames."""


@dataclass(frozen=True, slots=True)
class BorderPatches:
    """Linear continuations of n_x and n_y from patches on the borders of sheets.

    owner (H, W) int: number of the patch of a border pixel, -1 elsewhere. inner (H, W) bool: pixels of the sheets that
    have patches. centres (N, 2): row and column. values (N, 2): n_x and n_y there. slopes (N, 2, 2): their change to
    the right and down, per window. variances (N,): of a pixel about the fit. inverses (N, 3, 3): of the normal
    matrices. window: pixels.
    """

    owner: np.ndarray
    inner: np.ndarray
    centres: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    variances: np.ndarray
    inverses: np.ndarray
    window: float

    @classmethod
    def of(cls, normals: np.ndarray, mask: np.ndarray, inradius: float) -> "BorderPatches":
        """Fit the patches on all borders of sheets.

        normals: (H, W, 3) accepted ones, NaN elsewhere; mask: (H, W) bool; inradius: of the object, in pixels.
        """
        sheets = segment_sheets(normals, SHEET_TURN_DEG)
        inner = (sheets >= 0) & (np.bincount(sheets[sheets >= 0], minlength=1)[np.maximum(sheets, 0)] >= MIN_SHEET)
        gap = mask & ~inner
        # Single pixels without a normal have no border: only what holds a square of four.
        wide = ndimage.binary_dilation(ndimage.binary_opening(gap, np.ones((2, 2))), iterations=2)
        border = inner & wide & ndimage.binary_dilation(gap)
        spacing = max(PATCH_SPACING_INRADII * inradius, MIN_RADII_PX[0])
        window = max(PATCH_WINDOW_INRADII * inradius, MIN_RADII_PX[1])
        sheets = np.where(inner, sheets, -1)
        owner, nearest = np.full(mask.shape, -1), np.full(mask.shape, np.inf)
        fits: list[tuple[np.ndarray, ...]] = []
        for row, column in np.argwhere(border):
            if owner[row, column] >= 0:
                continue
            rows, columns = _same_sheet(sheets, row, column, window)
            distance = np.hypot(rows - row, columns - column)
            if (distance <= window).sum() < MIN_FIT:
                continue
            near = border[rows, columns] & (distance <= spacing) & (distance < nearest[rows, columns])
            owner[rows[near], columns[near]] = len(fits)
            nearest[rows[near], columns[near]] = distance[near]
            rows, columns, distance = (part[distance <= window] for part in (rows, columns, distance))
            offsets = np.stack([columns - column, rows - row], axis=-1) / window
            weights = np.exp(-0.5 * (distance / (window / 2.0)) ** 2)
            fits.append((np.array([row, column]), *_fit(offsets, normals[rows, columns, :2].astype(float), weights)))
        centres, values, slopes, variances, inverses = (
            np.array([fit[part] for fit in fits]).reshape(len(fits), *shape) for part, shape in enumerate(FIT_SHAPES)
        )
        return cls(owner, inner, centres, values, slopes, variances, inverses, window)

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.centres)

    def at(self, patches: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return n_x, n_y and their variance (M, 3) by which patches (M,) continue to rows and columns (M,)."""
        right = (columns - self.centres[patches, 1]) / self.window
        down = (rows - self.centres[patches, 0]) / self.window
        slopes, inverse = self.slopes[patches], self.inverses[patches]
        values = self.values[patches] + right[:, None] * slopes[:, 0] + down[:, None] * slopes[:, 1]
        place = np.stack([np.ones(len(right)), right, down], axis=-1)
        leverage = np.einsum("mi,mij,mj->m", place, inverse, place)
        variance = self.variances[patches] * (1.0 + CORRELATED_PX * leverage)
        return np.concatenate([values, variance[:, None]], axis=-1)


def _same_sheet(sheets: np.ndarray, row: int, column: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the pixels connected to one of its sheet within a square about it."""
    reach = int(np.ceil(radius))
    top, left = max(row - reach, 0), max(column - reach, 0)
    part = sheets[top : row + reach + 1, left : column + reach + 1] == sheets[row, column]
    pieces, _ = ndimage.label(part, np.ones((3, 3)))
    rows, columns = np.nonzero(pieces == pieces[row - top, column - left])
    return rows + top, columns + left


def _fit(offsets: np.ndarray, values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Fit values (M, 2) linearly to offsets (M, 2): value and slopes at 0, variance, inverse of the normal matrix."""
    design = np.concatenate([np.ones((len(offsets), 1)), offsets], axis=1)
    weighted = design * weights[:, None]
    inverse = np.linalg.inv(weighted.T @ design + np.diag([0.0, SLOPE_RIDGE, SLOPE_RIDGE]) * weights.sum())
    solution = inverse @ weighted.T @ values
    variance = (((design @ solution - values) ** 2).sum(axis=1) * weights).sum() / weights.sum()
    return solution[0], solution[1:], np.maximum(variance, MIN_FIT_DEVIATION**2), inverse
