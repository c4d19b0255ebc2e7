"""Distance transform: exact Euclidean distances in the image plane (Felzenszwalb and Huttenlocher 2012)."""

import cv2
import numpy as np


def distance_inside(region: np.ndarray) -> np.ndarray:
    """Return the distance in pixels (H, W) float32 from each pixel of a region to the nearest one outside, else 0.

    region: (H, W) bool; there must be a pixel outside it. The border of the image is not outside.
    """
    return np.asarray(cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE))


def depth_inside(mask: np.ndarray) -> np.ndarray:
    """Return the distance in pixels (H, W) float32 from each pixel of a mask (H, W) bool to the nearest one outside.

    What lies beyond the border of the image is outside, so that the mask may fill it.
    """
    return distance_inside(np.pad(mask, 1))[1:-1, 1:-1]


def inradius(mask: np.ndarray) -> float:
    """Return the radius in pixels of the largest circle inside the mask (H, W): the object's scale in the image."""
    return float(depth_inside(mask).max())
