"""Result of labelling one view, the same for all methods: labels, normals, their provenance and confidence."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, unit

PROVENANCE = ("outside", "observed", "marked", "silhouette", "filled")
"""Names of the codes in `Reconstruction.provenance`."""
OUTSIDE, OBSERVED, MARKED, SILHOUETTE, FILLED = range(len(PROVENANCE))
CONFIDENT = 0.95
"""Confidence from which a pixel counts as confident."""
NOISE_DEG, DETAIL_DEG = 3.0, 6.0
"""Angle between accepted normal and field up to which the difference is noise, and from which it is surface detail."""


@dataclass(frozen=True, slots=True)
class Iteration:
    """One iteration: pixels that have an exterior node, and pixels whose labels changed."""

    exterior: int
    changed: int


@dataclass(frozen=True, slots=True)
class BodyWall:
    """Wall of a surface of revolution that explains the labels.

    normals: (H, W, 3) float32, those of the surface. tangents: (H, W, 3) float32, unit, along its circles. Both are in
    the camera frame, NaN where the wall is not seen.
    """

    normals: np.ndarray
    tangents: np.ndarray


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """Labels and normals of one view.

    labels: (K, H, W) uint8, 1 = exterior surface.
    normals: (H, W, 3) float32, unit, camera frame, NaN outside the mask.
    initial: (H, W, 3) float32 likewise, the field from the silhouette alone.
    provenance: (H, W) uint8, codes of PROVENANCE.
    confidence: (H, W) float32, probability that the angular error is below 5 degrees, NaN outside the mask.
    iterations: what each iteration did, in order.
    body_depth: (H, W) float32, height in pixels towards the camera up to a constant, of the surface of revolution, the
        square vessel, the prism or the faceted body where the normals follow it, NaN elsewhere; None where there is no
        such body. Under perspective a height is the negative logarithm of the distance times the focal length.
    wall: of that surface of revolution, if it has no relief; None without.
    """

    labels: np.ndarray
    normals: np.ndarray
    initial: np.ndarray
    provenance: np.ndarray
    confidence: np.ndarray
    iterations: tuple[Iteration, ...]
    body_depth: np.ndarray | None = None
    wall: BodyWall | None = None


def exterior_normals(normals: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the normal of each pixel's exterior node (H, W, 3), NaN without, of normals (K, H, W, 3) and labels."""
    chosen = np.take_along_axis(normals, labels.argmax(axis=0)[None, :, :, None], axis=0)[0]
    return np.where(labels.any(axis=0)[..., None], chosen, np.nan)


def accepted_normals(normals: np.ndarray, labels: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """Return the accepted normal of each pixel (H, W, 3), NaN where there is none.

    It is that of the exterior node, a mean over frames, or else of the mark, which is of one frame.

    normals: (K, H, W, 3), candidates; labels: (K, H, W), nonzero = exterior; marked: (H, W, 3), NaN without a mark.
    """
    chosen = exterior_normals(normals, labels)
    return np.where(np.isnan(chosen), marked, chosen)


def exterior_values(values: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return the value (H, W) of each pixel's exterior node, of values and labels (K, H, W); arbitrary without one."""
    return np.take_along_axis(values, labels.argmax(axis=0)[None], axis=0)[0]


def blended_normals(accepted: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Return accepted normals (H, W, 3), blended into the field (H, W, 3) where they agree; the field where NaN.

    Light directions are sparse, so an accepted normal errs by about a degree, independently of its neighbours.
    """
    share = np.clip((DETAIL_DEG - angles(accepted, field)) / (DETAIL_DEG - NOISE_DEG), 0.0, 1.0)[..., None]
    return np.where(np.isnan(accepted), field, unit(share * field + (1.0 - share) * accepted))
