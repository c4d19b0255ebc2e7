"""Convex hull of a set of pixels."""

import cv2
import numpy as np


def convex_hull(pixels: np.ndarray) -> np.ndarray:
    """Return the convex hull (H, W) bool of the set pixels (H, W) bool, of which there is at least one."""
    points = np.argwhere(pixels)[:, ::-1].astype(np.int32)
    hull = np.zeros(pixels.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(points), 1)
    return hull > 0
