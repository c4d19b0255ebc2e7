"""Initial normals from the silhouette: rim normals and a smooth field inside, true marks kept (paper 4.1, METHOD 4)."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.candidates.markup import Marks, pinned
from glint.tasks.algorithms.prior.smooth_normals import rim_normals, smooth_field

HARD = 1e4
"""Weight of a marked normal: against a rim pixel's 1 it is a constraint."""


@dataclass(frozen=True, slots=True)
class Silhouette:
    """rim (H, W) bool; initial (H, W, 3) float32 normals, unit, n_z >= 0, NaN outside the mask."""

    rim: np.ndarray
    initial: np.ndarray


def initial_normals(
    mask: np.ndarray, *, marks: Marks | None = None, rim_weight: float = 1.0, tension_length: float = 0.12
) -> Silhouette:
    """Rim and initial normals of a mask (H, W) bool; holes, concavities and several components are all rims.

    marks: true ones are hard constraints at their pixels; rim_weight: pull of a rim pixel; tension_length: see `field`.
    """
    if not mask.any():
        raise ValueError("the mask is empty")
    rim, outward = rim_normals(mask)
    marked, values, _ = pinned(marks, np.empty((0, *mask.shape, 3), np.float32), mask)
    targets = np.where(marked[..., None], values, outward)
    weights = np.where(marked, HARD, np.where(rim, rim_weight, 0.0))
    return Silhouette(rim, smooth_field(mask, tension_length).solve(targets, weights))
