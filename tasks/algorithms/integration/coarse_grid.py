"""Normals at half the resolution, and heights at twice: large regions are integrated from coarse to fine."""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

MIN_BLOCK_PIXELS = 2
"""Pixels of a block of four that must lie in the mask for the block to do so."""


class NormalGrid(NamedTuple):
    """Normals on a grid of pixels.

    normals: (H, W, 3) float64, finite, camera frame; mask: (H, W) bool; weight: (H, W) float64 of each normal; camera:
    (3, 3) intrinsic matrix in pixels of the grid, None for an orthographic camera; body: (H, W) depth in pixels of the
    grid of what is known beforehand, NaN elsewhere, None without.
    """

    normals: np.ndarray
    mask: np.ndarray
    weight: np.ndarray
    camera: np.ndarray | None
    body: np.ndarray | None = None


def halved(grid: NormalGrid) -> NormalGrid:
    """Return the grid of blocks of 2 x 2 pixels: mean normals by weight, mean weights inside the mask, nearest depth.

    The mean of depths would lie within the steps.
    """
    inside = grid.mask.astype(float)
    pixels, weight = _block_sums(inside), _block_sums(inside * grid.weight)
    normals = _block_sums(grid.normals * (inside * grid.weight)[..., None])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    facing = np.array([0.0, 0.0, 1.0])
    camera = grid.camera
    if camera is not None:
        # The centre of a block lies half a pixel beyond that of its first pixel.
        camera = np.diag([0.5, 0.5, 1.0]) @ (camera - [[0.0, 0.0, 0.5], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])
    return NormalGrid(
        np.where(length > 0.0, normals / np.maximum(length, 1e-30), facing),
        pixels >= MIN_BLOCK_PIXELS,
        weight / np.maximum(pixels, 1.0),
        camera,
        None if grid.body is None else _nearest_depth(grid.body) / 2.0,
    )


def doubled(height: np.ndarray, mask: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return a height on a grid `halved`, with this mask, on the grid of `shape`, in its pixels; defined everywhere."""
    nearest = ndimage.distance_transform_edt(~mask, return_distances=False, return_indices=True)
    rows, columns = (np.maximum((np.arange(length) - 0.5) / 2.0, 0.0) for length in shape)
    places = np.meshgrid(rows, columns, indexing="ij")
    return np.asarray(2.0 * ndimage.map_coordinates(height[tuple(nearest)], places, order=1, mode="nearest"))


def _block_sums(values: np.ndarray) -> np.ndarray:
    """Return the sums of values (H, W, ...) over blocks of 2 x 2 pixels."""
    return np.asarray(_blocks(values, 0.0).sum(axis=(1, 3)))


def _nearest_depth(depth: np.ndarray) -> np.ndarray:
    """Return the largest depth (H, W) of each block of 2 x 2 pixels, NaN where it has none."""
    largest = _blocks(np.where(np.isnan(depth), -np.inf, depth), -np.inf).max(axis=(1, 3))
    return np.where(np.isfinite(largest), largest, np.nan)


def _blocks(values: np.ndarray, beyond: float) -> np.ndarray:
    """Return values (H, W, ...) as blocks (H / 2, 2, W / 2, 2, ...), with `beyond` outside of the array."""
    rows, columns = values.shape[:2]
    width = ((0, rows % 2), (0, columns % 2), *[(0, 0)] * (values.ndim - 2))
    padded = np.pad(values, width, constant_values=beyond)
    return np.asarray(padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2, *values.shape[2:]))
