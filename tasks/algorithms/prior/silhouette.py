"""Initial normals from the silhouette (section 4.1 of Yeung et al. 2009).

Occluding-contour normals and true marks are interpolated by a smooth normal field, in place of the Markov random field
of Wu et al. 2006 that the paper uses.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, smooth_normal_field

MARK_WEIGHT = 1e4
"""Weight of a marked normal: against a contour pixel's 1 it is a hard constraint."""


@dataclass(frozen=True, slots=True)
class Silhouette:
    """Normals that follow from a silhouette.

    contour: (H, W) bool, pixels of the occluding contour. normals: (H, W, 3) float32, the initial normals, unit,
    n_z >= 0, NaN outside the mask.
    """

    contour: np.ndarray
    normals: np.ndarray


def initial_normals(
    mask: np.ndarray, *, marks: Marks | None = None, contour_weight: float = 1.0, tension_length: float = 0.12
) -> Silhouette:
    """Compute occluding contour and initial normals of a mask; holes and concavities have contours too.

    Args:
        mask: (H, W) bool, of one or several components.
        marks: true ones are hard constraints at their pixels.
        contour_weight: weight of a contour pixel.
        tension_length: see `smooth_normal_field`.

    Raises:
        ValueError: the mask is empty.
    """
    if not mask.any():
        raise ValueError("the mask is empty")
    contour, outward = contour_normals(mask)
    marked, marked_normals, _ = mark_constraints(marks, np.empty((0, *mask.shape, 3), np.float32), mask)
    targets = np.where(marked[..., None], marked_normals, outward)
    weights = np.where(marked, MARK_WEIGHT, np.where(contour, contour_weight, 0.0))
    return Silhouette(contour, smooth_normal_field(mask, tension_length).solve(targets, weights))
