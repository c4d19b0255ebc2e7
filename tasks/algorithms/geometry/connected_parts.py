"""Connected parts of masks; pixels connect across their edges."""

import numpy as np
from scipy import ndimage


def largest_part(mask: np.ndarray) -> np.ndarray:
    """Return the largest connected part (H, W) bool of a mask (H, W) bool; an empty mask has none."""
    parts, count = ndimage.label(mask)
    return np.asarray(parts == np.bincount(parts.ravel())[1:].argmax() + 1) if count else mask
