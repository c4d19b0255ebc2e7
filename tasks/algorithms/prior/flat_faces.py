"""Flat faces as a hypothesis beside the smooth field and the surface of revolution: what they say of every pixel."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.prior.creases import crease_direction, crease_residual, creases, face_edges, rounding_radius
from glint.tasks.algorithms.prior.faces import find_faces
from glint.tasks.algorithms.prior.unseen_faces import unseen_faces

FACE_WEIGHT, UNSEEN_WEIGHT = 1.0, 0.1
"""Weights of a squared difference per pixel in the field: of a face's normal, and of one that never showed the light."""
MIN_CREASE_TURN_DEG = 20.0
"""Angle between two creases from which they are independent evidence for a face."""


@dataclass(frozen=True, slots=True)
class FlatFaces:
    """What flat faces say.

    normals: (H, W, 3) float32, NaN outside faces. weights: (H, W), theirs in the field. observed: (H, W) bool, faces
    that showed the light. spread: (H, W), standard deviation per axis in radians of the other faces' normals, NaN
    elsewhere. residual: (H, W), RMS residual of the creases of an observed face in standard deviations; NaN where fewer
    than two independent ones are known.
    """

    normals: np.ndarray
    weights: np.ndarray
    observed: np.ndarray
    spread: np.ndarray
    residual: np.ndarray


def flat_faces(accepted: np.ndarray, field: np.ndarray, mask: np.ndarray, scale: float) -> FlatFaces | None:
    """Find the flat faces of an object, and estimate those that never showed the light; None without any.

    Args:
        accepted: (H, W, 3), accepted normals, NaN elsewhere.
        field: (H, W, 3), the smooth normal field.
        mask: (H, W) bool.
        scale: inradius of the mask in pixels.
    """
    faces = find_faces(accepted, mask, scale)
    if not faces:
        return None
    edges = face_edges(faces, mask, scale)
    result = FlatFaces(
        np.full((*mask.shape, 3), np.nan, np.float32),
        np.zeros(mask.shape),
        np.zeros(mask.shape, bool),
        np.full(mask.shape, np.nan),
        np.full(mask.shape, np.nan),
    )
    between = creases(edges)
    known = np.isfinite(accepted[..., 0])
    rounding = rounding_radius(edges, faces, scale)
    for unseen in unseen_faces(faces, edges, known, field, mask, scale, rounding):
        result.normals[unseen.pixels] = unseen.normal
        result.weights[unseen.pixels] = UNSEEN_WEIGHT
        result.spread[unseen.pixels] = unseen.spread
    for number, face in reversed(list(enumerate(faces))):
        own = [(pair, along) for pair, along in between.items() if number in pair]
        directions = np.array([crease_direction(along, face.normal) for _, along in own]).reshape(-1, 3)
        turns = np.abs(directions @ directions.T) < np.cos(np.radians(MIN_CREASE_TURN_DEG))
        result.normals[face.hull] = face.normal
        result.weights[face.hull] = FACE_WEIGHT
        result.observed[face.hull] = True
        result.spread[face.hull] = np.nan
        if turns.any():
            residuals = [crease_residual(along, faces[a].normal, faces[b].normal) for (a, b), along in own]
            result.residual[face.hull] = np.sqrt(np.mean(np.square(residuals)))
    return result
