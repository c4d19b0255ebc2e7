"""Connected parts of masks, and the pixels beside each other that connect them."""

import numpy as np
from scipy import ndimage


def largest_part(mask: np.ndarray, *, diagonal: bool = False) -> np.ndarray:
    """Return the largest connected part (H, W) bool of a mask (H, W) bool; an empty mask has none.

    diagonal: whether pixels connect across their corners too, as those of a contour do, and not across edges alone.
    """
    parts, count = ndimage.label(mask, ndimage.generate_binary_structure(2, 2 if diagonal else 1))
    return np.asarray(parts == np.bincount(parts.ravel())[1:].argmax() + 1) if count else mask


def neighbours(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the windows (rows, columns) of the pixels of a picture that have a neighbour, and of these neighbours.

    shape: (H, W). down, right: rows, not negative, and columns from a pixel to its neighbour.
    """
    height, width = shape
    return (
        (slice(0, height - down), slice(max(0, -right), width - max(0, right))),
        (slice(down, height), slice(max(0, right), width + min(0, right))),
    )
