"""Robust statistics."""

import numpy as np

GAUSSIAN_RATIO = 1.4826
"""Ratio of a Gaussian's standard deviation to the median of its absolute values."""


def robust_deviation(residuals: np.ndarray) -> float:
    """Return the standard deviation of residuals (..) about 0, unmoved by outliers, by the median of their sizes."""
    return GAUSSIAN_RATIO * float(np.median(np.abs(residuals)))
