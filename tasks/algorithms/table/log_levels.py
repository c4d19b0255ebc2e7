"""Logarithm of levels, in which a pattern has the same contrast in the light as in the shadow."""

import numpy as np

DARK_LEVEL = 8.0
"""Level, of 255, that is added before the logarithm, so that noise of dark pixels makes no edge and no texture."""


def log_levels(levels: np.ndarray) -> np.ndarray:
    """Return the logarithm (...) float32 of levels (...), 0 to 255."""
    return np.log(levels.astype(np.float32) + DARK_LEVEL)
