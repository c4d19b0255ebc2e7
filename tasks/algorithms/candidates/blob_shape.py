"""Shape of a bright blob: its centre by second moments (Hu 1962), and whether it is a single highlight."""

import cv2
import numpy as np

ELONGATION_LIMIT = 3.0
"""Ratio of length to width beyond which a highlight is a line, along which the surface does not bend."""
MIN_SOLIDITY = 0.8
"""Share of its convex hull that a single highlight fills; merged ones leave gaps between them."""


def blob_centre(blob: np.ndarray, position: tuple[float, float]) -> tuple[float, float] | None:
    """Return the centre x, y of a blob (h, w) bool; of a line the point of its axis nearest to a position (x, y).

    None for a blob that the window's border cuts, unless it is a line.
    """
    pixels = np.argwhere(blob)[:, ::-1].astype(float)
    centre = pixels.mean(axis=0)
    # A rectangle's variance is its side squared over 12; a pixel is one itself. So these are half its sides.
    values, vectors = np.linalg.eigh(np.cov(pixels.T, bias=True) + np.eye(2) / 12.0)
    width, length = np.sqrt(3.0 * values)
    direction = vectors[:, 1]
    slack = max(0.0, length - ELONGATION_LIMIT * width)
    is_cut = pixels.min() == 0 or (pixels.max(axis=0) == np.array(blob.shape)[::-1] - 1).any()
    if is_cut and slack == 0:
        return None
    nearest = centre + direction * np.clip((np.array(position) - centre) @ direction, -slack, slack)
    # A line that is thicker at one end is shorter than a rectangle of the same variance, on that side of its centroid.
    x, y = nearest.clip(pixels.min(axis=0), pixels.max(axis=0))
    return float(x), float(y)


def is_single_highlight(blob: np.ndarray) -> bool:
    """Return whether a blob (h, w) bool fills its convex hull, as a single highlight does."""
    rows, columns = np.nonzero(blob)
    hull = cv2.convexHull(np.stack([columns, rows], axis=-1).astype(np.int32))
    # Pixels of a polygon through pixel centres: Pick's theorem, with the perimeter for the points on the boundary.
    hull_pixels = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    return len(rows) >= MIN_SOLIDITY * hull_pixels
