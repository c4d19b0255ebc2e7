"""Initial normals from the silhouette: rim and the smooth field inside it (paper 4.1, METHOD 4)."""

from dataclasses import dataclass

import numpy as np

from tasks.algorithms.field import rim_normals, smooth_field


@dataclass(frozen=True, slots=True)
class Silhouette:
    """rim (H, W) bool; initial (H, W, 3) float32, unit, NaN outside the mask."""

    rim: np.ndarray
    initial: np.ndarray


def initial_normals(mask, *, marks=None, rim_weight=1.0, tension_length=0.12):
    rim, outward = rim_normals(mask)
    surface = smooth_field(mask, tension_length)
    return Silhouette(rim, surface.solve(outward, np.where(rim, rim_weight, 0.0)))
