"""Texture of the background: where it is unlike the table's, the table is seen through glass.

A clear wall follows the light as the table does, but refracts it: the table's pattern is compressed there, turned,
blurred or mixed with another. The local texture is described by its structure tensor (Bigün and Granlund 1987) at two
scales, and compared with that of the table around the object.
"""

import cv2
import numpy as np

from glint.tasks.algorithms.table.log_levels import log_levels
from glint.tasks.algorithms.table.trimmed_normal import squared_distance, trimmed_normal

SCALES_PX = 0.8, 2.0
"""Standard deviations of the smoothing before slopes are taken."""
TEXTURE_WINDOW_SHARE, MIN_TEXTURE_WINDOW_PX = 0.02, 2.0
"""Standard deviation of the window over which slopes are averaged, as a share of the square root of the object's area,
and the least in pixels: smaller objects have too few pixels for a texture."""
LEAST_SLOPE = 0.003
"""Slope of the log level per pixel that is added: less is no texture."""
ALTERED_SHARE = 0.5
"""Share of the glass through which the table's texture is another one: thin walls show it as it is."""
MAX_TEXTURE_RATIO = 2.0
"""Bound of the log Bayes factor, nats: a pattern on the table may be unlike the rest of it too."""
EROSION_WINDOWS = 1.75
"""Distance, in windows, from which a texture is seen beside its place."""
MIN_TABLE_PX = 50
"""Pixels of the table without which nothing is known of its texture."""


def texture_ratio(background: np.ndarray, is_table: np.ndarray, root_area: float) -> np.ndarray:
    """Return the evidence (H, W) that the background at a pixel is not the bare table, log Bayes factor in nats.

    The share u of the table's pixels whose texture is as unlike its mean is uniform on the table; where the texture is
    altered small shares are more frequent, with the density u^(-1/2) / 2 (Sellke, Bayarri and Berger 2001). A window
    beside the object reaches into it, so the least evidence nearby counts.

    Args:
        background: (H, W), 0 to 255.
        is_table: (H, W) bool, pixels of the table around the object.
        root_area: square root of the object's area, pixels.
    """
    window = TEXTURE_WINDOW_SHARE * root_area
    if is_table.sum() < MIN_TABLE_PX or window < MIN_TEXTURE_WINDOW_PX:
        return np.zeros(background.shape)
    texture = _texture(background, window)
    mean, covariance = trimmed_normal(texture[is_table])
    distance = squared_distance(texture - mean, covariance)
    table = np.sort(distance[is_table])
    share = (len(table) + 1 - np.searchsorted(table, distance)) / (len(table) + 1)
    factor = 1.0 - ALTERED_SHARE + ALTERED_SHARE * 0.5 / np.sqrt(share)
    ratio = np.minimum(np.log(factor), MAX_TEXTURE_RATIO)
    size = 2 * round(EROSION_WINDOWS * window) + 1
    return cv2.erode(ratio, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)))


def _texture(background: np.ndarray, window: float) -> np.ndarray:
    """Return the texture (H, W, 6) of the background: log strength and double-angle direction at each scale."""
    levels = log_levels(background)
    channels = []
    for scale in SCALES_PX:
        down, right = np.gradient(cv2.GaussianBlur(levels, (0, 0), scale))
        across, along, mixed = (
            cv2.GaussianBlur(product, (0, 0), window) for product in (right * right, down * down, right * down)
        )
        total = across + along + LEAST_SLOPE**2
        channels += [np.log(total), (across - along) / total, 2.0 * mixed / total]
    return np.stack(channels, axis=-1)
