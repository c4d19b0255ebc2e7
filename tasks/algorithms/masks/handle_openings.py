"""Openings of handles: the table between a handle and its vessel.

The clear wall of a vessel shows the table just as an opening does. But an opening lies in what stands off on one side
of the body, which is symmetric about its axis, and the handle encloses it.
"""

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.masks.mask_regions import without_specks
from glint.tasks.algorithms.silhouettes.mirror_images import MirrorAxis, mirror_image, symmetric_body

MIN_OPENING_RATIO, MIN_OPENING_PX = 0.002, 12
"""Area of the smallest opening, relative to the object's and in pixels."""
MIN_HANDLE_RATIO = 0.02
"""Area of the smallest handle with its opening, relative to the object's."""
MIN_THICKNESS_PX = 2
"""Least thickness of a handle."""
SPECK = np.ones((3, 3))
"""What is narrower than this is noise, or the contour's."""


def handle_openings(mask: np.ndarray, is_like_table: np.ndarray, axis: MirrorAxis) -> np.ndarray:
    """Return the pixels (H, W) bool of a mask (H, W) bool that are openings of a handle.

    is_like_table: (H, W) bool, pixels that follow the light as the table does. axis: of the body.
    """
    is_like_table = ndimage.binary_opening(mask & is_like_table, SPECK)
    min_area = max(MIN_OPENING_PX, MIN_OPENING_RATIO * float(mask.sum()))
    if not without_specks(is_like_table, min_area, diagonal=False).any():
        return np.zeros_like(mask)
    body = symmetric_body(mask, mirror_image(mask, axis))
    if body is None:
        return np.zeros_like(mask)
    handle = largest_part(ndimage.binary_opening(mask & ~body, SPECK))
    if handle.sum() < MIN_HANDLE_RATIO * mask.sum():
        return np.zeros_like(mask)
    components, _ = ndimage.label(without_specks(is_like_table & handle, min_area, diagonal=False))
    at_rim = components[~ndimage.binary_erosion(mask, SPECK, iterations=MIN_THICKNESS_PX)]
    return np.asarray((components > 0) & ~np.isin(components, at_rim))
