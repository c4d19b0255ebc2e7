"""Gaussian blur of images whose pixels number millions, and of what is scattered over samples of a line."""

import cv2
import numpy as np
from scipy import ndimage

TRUNCATED_SD = 4.0
"""Standard deviations at which the kernel ends."""
COARSE_SD_PX = 8.0
"""Standard deviation in pixels of a coarser image in which a wide blur is made: it changes values by some thousandths
of their range."""


def gaussian_blur(values: np.ndarray, sd: float) -> np.ndarray:
    """Return values (H, W) blurred by a Gaussian of `sd` pixels, float32; the image is mirrored at its border."""
    image = np.asarray(values, np.float32)
    height, width = image.shape
    shrink = int(min(sd / COARSE_SD_PX, height / 2, width / 2))
    if shrink < 2:
        return _blurred(image, sd, sd)
    small = cv2.resize(image, (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)
    small = _blurred(small, sd * small.shape[1] / width, sd * small.shape[0] / height)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))


def blurred_sums(
    samples: np.ndarray, weights: np.ndarray, values: np.ndarray, length: int, sd: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of weights (N,), and of weights times values (N,), blurred by a Gaussian of `sd` samples.

    samples: (N,) int, of a line of so many, to which they belong; the sums are (length,) float64. Beyond its ends there
    is nothing.
    """
    total, sums = (
        ndimage.gaussian_filter1d(np.bincount(samples, terms, minlength=length), sd, mode="constant")
        for terms in (weights, weights * values)
    )
    return total, sums


def _blurred(image: np.ndarray, sd_x: float, sd_y: float) -> np.ndarray:
    size = (2 * int(TRUNCATED_SD * sd_x + 0.5) + 1, 2 * int(TRUNCATED_SD * sd_y + 0.5) + 1)
    return np.asarray(cv2.GaussianBlur(image, size, sd_x, sigmaY=sd_y, borderType=cv2.BORDER_REFLECT))
