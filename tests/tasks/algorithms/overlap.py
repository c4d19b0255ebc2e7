"""How alike two masks are."""

import numpy as np


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    """Return the intersection over union of two masks (H, W) bool."""
    return float((first & second).sum() / (first | second).sum())
