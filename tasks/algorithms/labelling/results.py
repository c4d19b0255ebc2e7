"""Result of labelling one view, the same for all methods: labels, normals, their provenance and confidence."""

from dataclasses import dataclass

import numpy as np

PROVENANCE = ("outside", "observed", "marked", "silhouette", "filled")
"""Names of the codes in `Reconstruction.provenance`."""
OUTSIDE, OBSERVED, MARKED, SILHOUETTE, FILLED = range(len(PROVENANCE))


@dataclass(frozen=True, slots=True)
class Iteration:
    """One iteration: pixels that have an exterior node, and pixels whose labels changed."""

    exterior: int
    changed: int


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """Labels and normals of one view.

    labels: (K, H, W) uint8, 1 = exterior surface.
    normals: (H, W, 3) float32, unit, camera frame, NaN outside the mask.
    initial: (H, W, 3) float32 likewise, the field from the silhouette alone.
    provenance: (H, W) uint8, codes of PROVENANCE.
    confidence: (H, W) float32, probability that the angular error is below 5 degrees, NaN outside the mask.
    iterations: what each iteration did, in order.
    """

    labels: np.ndarray
    normals: np.ndarray
    initial: np.ndarray
    provenance: np.ndarray
    confidence: np.ndarray
    iterations: tuple[Iteration, ...]
