"""Distance transform: exact Euclidean distances in the image plane (Felzenszwalb and Huttenlocher 2012)."""

import cv2
import numpy as np


def distance_inside(region: np.ndarray) -> np.ndarray:
    """Return the distance in pixels (H, W) float32 from each pixel of a region to the nearest one outside, else 0.

    region: (H, W) bool; there must be a pixel outside it. The border of the image is not outside.
    """
    return np.asarray(cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE))
