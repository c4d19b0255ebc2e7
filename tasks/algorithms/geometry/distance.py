"""Distance transform: exact Euclidean distances in the image plane (Felzenszwalb and Huttenlocher 2012)."""

import cv2
import numpy as np
from scipy import ndimage


def distance_inside(region: np.ndarray) -> np.ndarray:
    """Return the distance in pixels (H, W) float32 from each pixel of a region to the nearest one outside, else 0.

    region: (H, W) bool; there must be a pixel outside it. The border of the image is not outside.
    """
    distance = cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # OpenCV's root differs in its last digit with the array's address, which would make results differ between runs.
    # Squared distances are whole numbers: rounding recovers them wherever OpenCV is exact, to 800 pixels and more.
    return np.asarray(np.sqrt(np.rint(distance * distance)))


def depth_inside(mask: np.ndarray) -> np.ndarray:
    """Return the distance in pixels (H, W) float32 from each pixel of a mask (H, W) bool to the nearest one outside.

    What lies beyond the border of the image is outside, so that the mask may fill it.
    """
    return distance_inside(np.pad(mask, 1))[1:-1, 1:-1]


def inradius_of(mask: np.ndarray) -> float:
    """Return the radius in pixels of the largest circle inside the mask (H, W): the object's scale in the image."""
    return float(depth_inside(mask).max())


def with_nearest(normals: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return normals (H, W, 3) of which NaN in the mask (H, W) bool are those of the nearest pixel; NaN outside it."""
    nearest = ndimage.distance_transform_edt(np.isnan(normals[..., 0]), return_distances=False, return_indices=True)
    return np.where(mask[..., None], normals[tuple(nearest)], np.nan)
