"""Connected parts of masks."""

import numpy as np
from scipy import ndimage


def largest_part(mask: np.ndarray, *, diagonal: bool = False) -> np.ndarray:
    """Return the largest connected part (H, W) bool of a mask (H, W) bool; an empty mask has none.

    diagonal: whether pixels connect across their corners too, as those of a contour do, and not across edges alone.
    """
    parts, count = ndimage.label(mask, ndimage.generate_binary_structure(2, 2 if diagonal else 1))
    return np.asarray(parts == np.bincount(parts.ravel())[1:].argmax() + 1) if count else mask
