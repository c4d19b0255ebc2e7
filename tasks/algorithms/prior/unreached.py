"""Normals that no light reached: where nothing flashed, the surface is steeper than all normals that the lights show.

A surface whose normal is a half vector of the recording shows the light. Where the smooth field passes through such
normals, and yet none of a group of neighbouring pixels has a true highlight, the field is wrong: the surface turns away
from the lights, as in a groove, under a chin or beside a limb. How steep it is there is not known, but that it is
steeper than what the lights reach; which way follows from the heights on both sides (integrability).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from glint.tasks.algorithms.geometry.vectors import gradients, unit
from glint.tasks.algorithms.integration.expected_rises import poisson_source
from glint.tasks.algorithms.integration.multigrid import solve_poisson

CELLS = 200
"""Cells of a half-vector map along either axis; a cell in the middle is half a degree wide."""
MIN_COUNT = 3
"""Candidates in a cell from which it holds half vectors of the recording: single ones are noise."""
FLASH_DEG, BEYOND_DEG = 1.5, 7.0
"""Angle to a half vector of the recording up to which a normal is certain to flash, and from which it is well beyond
the lights' reach. Beyond 4 degrees hardly any normal flashes; dark ones are steeper than that by 7 on average."""
DARK_WINDOW_INRADII = 0.02
"""Half the side of the square windows in which nothing may flash, in inradii of the object."""
MIN_DARK_SHARE = 0.75
"""Share of such a window whose field must face the lights."""
MIN_LIT_SHARE = 0.5
"""Share of the pixels facing the lights that must have a true highlight: where most have none, as with wrong lights,
darkness says nothing of a normal."""
DARK_ROUNDS = 4
"""Solutions of the field: the directions of dark pixels follow from the one before."""
MAX_LENGTH = 0.9
"""Length of (n_x, n_y) beyond which dark pixels are not bent: a normal in the image plane has slopes without bounds."""
MIN_NZ = 0.2
"""Least z of a normal whose slope is integrated: steeper ones say little of heights."""
UNKNOWN_WEIGHT = 0.0005
"""Weight of slopes that neither a highlight nor darkness tells, against 1 for frontal accepted normals."""


@dataclass(frozen=True, slots=True)
class SweptNormals:
    """Normals that the lights of a recording reach, on a square map of (n_x, n_y).

    flashing (CELLS, CELLS) bool: those certain to show the light. reached: those that are not well beyond the lights'
    reach. beyond (2, CELLS, CELLS): row and column of the nearest cell that is.
    """

    flashing: np.ndarray
    reached: np.ndarray
    beyond: np.ndarray

    @classmethod
    def of(cls, candidates: np.ndarray) -> "SweptNormals | None":
        """Return the normals reached by the lights that caused candidates (K, H, W, 3; NaN where there is none).

        True or false, candidates are half vectors of the recording. None without any.
        """
        present = candidates[np.isfinite(candidates[..., 0])]
        count = np.zeros((CELLS, CELLS), int)
        np.add.at(count, _cells(present), 1)
        centres = (np.arange(CELLS) + 0.5) / CELLS * 2.0 - 1.0
        x, y = np.meshgrid(centres, centres)
        normals = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
        half_vectors = normals[count >= MIN_COUNT]
        if not half_vectors.size:
            return None
        chord = cKDTree(half_vectors).query(normals, distance_upper_bound=np.radians(BEYOND_DEG))[0]
        chord[x**2 + y**2 > 1.0] = np.inf
        reached = np.isfinite(chord)
        beyond = ndimage.distance_transform_edt(reached, return_distances=False, return_indices=True)
        return cls(chord <= np.radians(FLASH_DEG), reached, beyond)

    def flashes(self, normals: np.ndarray) -> np.ndarray:
        """Return whether normals (..., 3) are certain to show the light; not those that are NaN."""
        return np.asarray(self.flashing[_cells(normals)] & np.isfinite(normals[..., 0]))

    def nearest_beyond(self, normals: np.ndarray) -> np.ndarray:
        """Return the nearest normals (..., 3) well beyond what the lights reach, but no further out than MAX_LENGTH."""
        cells = _cells(normals)
        nearest = np.stack([self.beyond[1][cells], self.beyond[0][cells]], axis=-1)
        plane = np.where(self.reached[cells][..., None], (nearest + 0.5) / CELLS * 2.0 - 1.0, normals[..., :2])
        length = np.hypot(plane[..., 0], plane[..., 1])[..., None]
        plane = plane * np.minimum(1.0, MAX_LENGTH / np.maximum(length, 1e-6))
        return np.concatenate([plane, np.sqrt(1.0 - (plane**2).sum(axis=-1, keepdims=True))], axis=-1)


def _cells(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and columns (...) of the cells of normals (..., 3)."""
    column, row = (
        np.clip(((np.nan_to_num(normals[..., axis]) + 1.0) / 2.0 * CELLS).astype(int), 0, CELLS - 1) for axis in (0, 1)
    )
    return row, column


def dark_pixels(
    field: np.ndarray, lit: np.ndarray, mask: np.ndarray, swept: SweptNormals, inradius: float
) -> np.ndarray:
    """Return the pixels (H, W) bool of windows in which nothing flashed although the field faces the lights.

    field: (H, W, 3); lit: (H, W) bool, of `unreached_normals`; mask: (H, W) bool; inradius: of the object, in pixels.
    """
    side = 2 * max(1, round(DARK_WINDOW_INRADII * inradius)) + 1
    square = np.ones((side, side), bool)
    empty = ndimage.binary_erosion(~lit, square, border_value=1)
    facing = ndimage.uniform_filter((mask & ~lit & swept.flashes(field)).astype(np.float32), side)
    return mask & ~lit & ndimage.binary_dilation(empty & (facing >= MIN_DARK_SHARE), square)


def unreached_normals(
    field: np.ndarray,
    confidence: np.ndarray,
    lit: np.ndarray,
    mask: np.ndarray,
    swept: SweptNormals,
    inradius: float,
    solve: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray] | None:
    """Estimate the normals (H, W, 3) of dark pixels, NaN elsewhere, and the field (H, W, 3) that follows them.

    None where nothing is dark, or where fewer than MIN_LIT_SHARE of the pixels that face the lights have an accepted
    normal.

    Args:
        field: (H, W, 3), smooth normal field, finite in the mask.
        confidence: (H, W), of accepted normals, 0 elsewhere.
        lit: (H, W) bool, pixels with an accepted normal, or with a rejected one that is plausible.
        mask: (H, W) bool.
        swept: normals that the lights reach.
        inradius: of the object, in pixels.
        solve: returns the field (H, W, 3) with normals (H, W, 3; NaN elsewhere) among its data.
    """
    facing = mask & swept.flashes(field)
    if (facing & (confidence > 0.0)).sum() < MIN_LIT_SHARE * facing.sum():
        return None
    dark = np.zeros_like(mask)
    for number in range(DARK_ROUNDS):
        dark = dark | dark_pixels(field, lit, mask, swept, inradius)
        if not dark.any():
            return None
        direction = _integrable(field, np.where(dark, 1.0, confidence), mask) if number else field
        unreached = np.where(dark[..., None], swept.nearest_beyond(direction), np.nan)
        field = solve(unreached)
    return unreached, field


def with_unreached(
    targets: np.ndarray, weights: np.ndarray, unreached: np.ndarray, weight: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the field's targets (H, W, 3) and their weights (H, W) with normals of dark pixels where nothing else is.

    unreached: (H, W, 3), NaN elsewhere; weight: theirs.
    """
    applies = (weights == 0.0) & np.isfinite(unreached[..., 0])
    return np.where(applies[..., None], unreached, targets), np.where(applies, weight, weights)


def _integrable(field: np.ndarray, confidence: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the normals (H, W, 3) of the surface whose slopes fit a field best, at a pixel by its edges' mean slopes.

    confidence: (H, W), 0 where the field is neither dark nor accepted. mask: (H, W) bool.
    """
    p, q = gradients(field, floor=MIN_NZ)
    # The error of a slope is that of its normal divided by n_z squared.
    weight = np.where(confidence > 0.0, confidence * field[..., 2] ** 4, UNKNOWN_WEIGHT)
    slopes = np.where(mask, -q, 0.0), np.where(mask, p, 0.0)
    weights, rises = np.zeros((2, *mask.shape)), np.zeros((2, *mask.shape))
    total, count = np.zeros((2, *mask.shape)), np.zeros((2, *mask.shape))
    for axis, slope in enumerate(slopes):
        first, second = _ends(axis)
        inside = mask[first] & mask[second]
        weights[axis][first] = np.where(inside, np.minimum(weight[first], weight[second]), 0.0)
        rises[axis][first] = (slope[first] + slope[second]) / 2.0
    height, _, _ = solve_poisson(weights, poisson_source(weights, rises), np.zeros(mask.shape), tolerance=1e-4)
    for axis in (0, 1):
        first, second = _ends(axis)
        edge = (weights[axis][first] > 0.0) * 1.0
        rise = edge * (height[second] - height[first])
        for end in (first, second):
            total[axis][end] += rise
            count[axis][end] += edge
    down, right = total / np.maximum(count, 1.0)
    return unit(np.stack([-right, down, np.ones(mask.shape)], axis=-1))


def _ends(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the index of the pixels at which edges along an axis begin, and of those at which they end."""
    first, second, whole = slice(None, -1), slice(1, None), slice(None)
    return ((first, whole), (second, whole)) if axis == 0 else ((whole, first), (whole, second))
