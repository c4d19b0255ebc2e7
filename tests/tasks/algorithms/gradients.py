"""Normals of surfaces whose gradients are known."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit


def from_gradients(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Unit normals (..., 3) of the gradients p and q (...)."""
    return unit(np.stack([-p, -q, np.ones_like(p)], axis=-1))
