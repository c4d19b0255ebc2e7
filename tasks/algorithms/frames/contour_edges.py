"""Edges of an image along a contour: its slope across the contour, in units of the slopes of the table's texture."""

import cv2
import numpy as np
from scipy import ndimage

DARK_LEVEL = 8.0
"""Level, of 255, that is added before the logarithm, so that noise of dark pixels makes no edge."""
BLUR_SIGMA_PX = 0.6
"""Standard deviation of the smoothing before slopes are taken."""
TEXTURE_QUANTILE, MIN_SLOPE = 0.8, 0.01
"""Quantile of the table's slopes that counts as its texture, and the slope added for a table without texture."""
NORMAL_SIGMA_PX = 1.5
"""Standard deviation of the smoothing of a mask from which the contour's normals are taken."""
MIN_OUTER_EDGE, MIN_EDGE_RATIO, MIN_PIECE_PX = 1.0, 1.1, 8
"""Mean edge along a contour farther out, in edges of the table and relative to the contour that it replaces; area."""


def edge_image(levels: np.ndarray, is_table: np.ndarray) -> np.ndarray:
    """Return log levels (H, W), 0 to 255, such that a slope of 1 per pixel is an edge of the table's texture."""
    brightness = cv2.GaussianBlur(np.log(levels.astype(np.float32) + DARK_LEVEL), (0, 0), BLUR_SIGMA_PX)
    slopes = np.hypot(*np.gradient(brightness))[is_table]
    texture = float(np.quantile(slopes, TEXTURE_QUANTILE)) if len(slopes) else 0.0
    return np.asarray(brightness / (texture + MIN_SLOPE))


def slope_across(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the absolute slope (H, W) of an image across the contour of a mask (H, W) bool, near that contour."""
    down, right = np.gradient(image)
    normal_down, normal_right = np.gradient(cv2.GaussianBlur(mask.astype(np.float32), (0, 0), NORMAL_SIGMA_PX))
    length = np.hypot(normal_down, normal_right) + 1e-6
    return np.asarray(np.abs(down * normal_down + right * normal_right) / length)


def contour_pixels(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool on both sides of the contour of a mask (H, W) bool."""
    return ndimage.binary_dilation(mask) & ~ndimage.binary_erosion(mask)


def stronger_pieces(mask: np.ndarray, outer: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return the pieces (H, W) bool of `outer` beside `mask` whose outer contour is the stronger edge of an image."""
    outer_slope, inner_slope = slope_across(image, outer), slope_across(image, mask)
    outer_contour, inner_contour = contour_pixels(outer) & ~ndimage.binary_dilation(mask), contour_pixels(mask)
    pieces, _ = ndimage.label(outer & ~mask)
    result = np.zeros_like(mask)
    for number, window in enumerate(ndimage.find_objects(pieces), 1):
        grown = tuple(slice(max(0, side.start - 2), side.stop + 2) for side in window)
        piece = pieces[grown] == number
        near = ndimage.binary_dilation(piece)
        new, old = outer_contour[grown] & near, inner_contour[grown] & near
        if piece.sum() < MIN_PIECE_PX or not new.any() or not old.any():
            continue
        strength, replaced = float(outer_slope[grown][new].mean()), float(inner_slope[grown][old].mean())
        if strength > MIN_OUTER_EDGE and strength > MIN_EDGE_RATIO * replaced:
            result[grown] |= piece
    return result
