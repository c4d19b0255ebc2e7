"""Depth, mask and normals of an inclined plane."""

import numpy as np

from tests.tasks.algorithms.geometry.gradient_normals import from_gradients


def plane(height: int = 12, width: int = 17, p: float = 0.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, mask and normals of an inclined plane that fills its region."""
    depth = (p * np.indices((height, width))[1]).astype(np.float32)
    normals = np.broadcast_to(from_gradients(np.array(p), np.array(0.0)), (height, width, 3)).astype(np.float32)
    return depth, np.ones((height, width), bool), normals
