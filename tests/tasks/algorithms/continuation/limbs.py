"""A near limb before a far one, both upright cylinders: candidates that lights near the view show, mask and truth."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit

RADIUS = 16.0
SIZE = 70, 76
CONTOUR = 31
"""First column of the near limb, whose contour hides the far one."""
LIT_DEG = 44.0


def limbs(*, has_near: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Candidates (2, H, W, 3), mask and true normals (H, W, 3); has_near: whether the near limb is there.

    The limbs leave the picture above and below, so that the silhouette has contours at their sides alone. The second
    candidate is false, at a third of the pixels.
    """
    rng = np.random.default_rng(3)
    columns = np.indices(SIZE)[1] + 0.5
    far, near = (columns - 26.0) / RADIUS, (columns - CONTOUR - RADIUS) / RADIUS
    across = np.where((np.abs(near) < 1.0) & has_near, near, far)
    mask = np.abs(across) < 1.0
    truth = np.stack([across, np.zeros(SIZE), np.sqrt(np.maximum(1.0 - across**2, 0.0))], axis=-1)
    seen = unit(truth + rng.normal(0.0, 0.01, truth.shape))
    seen[truth[..., 2] < np.cos(np.radians(LIT_DEG))] = np.nan
    tilt, turn = np.radians(LIT_DEG) * np.sqrt(rng.random(SIZE)), 2.0 * np.pi * rng.random(SIZE)
    false = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    false[rng.random(SIZE) < 2.0 / 3.0] = np.nan
    candidates = np.where(mask[..., None], np.stack([seen, false]), np.nan).astype(np.float32)
    return candidates, mask, np.where(mask[..., None], truth, np.nan)
