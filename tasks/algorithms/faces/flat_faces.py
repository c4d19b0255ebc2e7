"""Flat faces as a hypothesis beside the smooth field and the surface of revolution: what they say of every pixel."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.faces.creases import (
    SILHOUETTE,
    ObservedFaces,
    crease_direction,
    crease_residual,
    creases,
    face_edges,
)
from glint.tasks.algorithms.faces.observed_faces import Face, find_faces
from glint.tasks.algorithms.faces.rounded_edges import rounding_evidence
from glint.tasks.algorithms.faces.unseen_faces import unseen_faces
from glint.tasks.algorithms.geometry.vectors import angles

FACE_WEIGHT, UNSEEN_WEIGHT = 1.0, 0.03
"""Weights per pixel in the field: of a face that showed the light, and of one that never did."""
MIN_CREASE_TURN_DEG = 20.0
"""Angle between two creases from which they are independent evidence for a face."""
APPARENT_DEG = 3.0
"""Angle to an apparent face's normal up to which a candidate belongs to it."""
MAX_FACE_ERROR_DEG, MIN_FACETED_SHARE = 3.0, 0.05
"""Mean angle between flat faces and another surface, and share of the accepted normals that belong to them, from which
the object is faceted instead: a small false sheet can be flat."""
ROUNDED_SHARE, CUT_OFF_SHARE = 0.9, 0.65
"""Share of a face's edges that must show their rounding to prove that edges are rounded, and below which, on such an
object, an apparent face is refuted."""
MIN_TESTED_INRADII = 1.0
"""Length in inradii of edges that either needs."""


@dataclass(frozen=True, slots=True)
class FlatFaces:
    """Statements of flat faces about each pixel.

    normals: (H, W, 3) float32, NaN outside faces. weights: (H, W), theirs in the field. observed: (H, W) bool, faces
    that showed the light. spread: (H, W), standard deviation per axis in radians of the other faces' normals, NaN
    elsewhere. residual: (H, W), RMS residual of the creases of an observed face in standard deviations; NaN where fewer
    than two independent ones are known. refuted: (H, W, 3) float32, normals of apparent faces that are cut off instead
    of bending away at their edges, NaN elsewhere; they are no part of the rest.
    """

    normals: np.ndarray
    weights: np.ndarray
    observed: np.ndarray
    spread: np.ndarray
    residual: np.ndarray
    refuted: np.ndarray

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> "FlatFaces":
        """Return the statements of no face about the pixels of an image of this shape."""
        return cls(
            normals=np.full((*shape, 3), np.nan, np.float32),
            weights=np.zeros(shape),
            observed=np.zeros(shape, bool),
            spread=np.full(shape, np.nan),
            residual=np.full(shape, np.nan),
            refuted=np.full((*shape, 3), np.nan, np.float32),
        )

    def constrain(
        self, targets: np.ndarray, weights: np.ndarray, known: np.ndarray, marked: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the field's targets (H, W, 3) and their weights (H, W) with the faces among them.

        A face that showed the light is known all over but at marks, the others only where nothing else is.

        known, marked: (H, W) bool, pixels of accepted and of marked normals.
        """
        applies = np.where(self.observed, ~marked, ~known) & (self.weights > 0)
        return np.where(applies[..., None], self.normals, targets), np.where(applies, self.weights, weights)


def flat_faces(
    accepted: np.ndarray,
    lights: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray,
    mask: np.ndarray,
    inradius: float,
) -> FlatFaces | None:
    """Find the flat faces of an object, and estimate those that never showed the light; None without any.

    Args:
        accepted: (H, W, 3), accepted normals, NaN elsewhere.
        lights: (H, W), weights of their clusters (see `find_faces`).
        candidates: (K, H, W, 3), NaN where there is none; they show whether edges are rounded.
        field: (H, W, 3), the smooth normal field.
        mask: (H, W) bool.
        inradius: of the mask, in pixels.
    """
    apparent = find_faces(accepted, lights, mask, inradius)
    if not apparent:
        return None
    faces, refuted = _tested(apparent, candidates, mask, inradius)
    result = FlatFaces.none(mask.shape)
    for face in refuted:
        result.refuted[face.pixels] = face.normal
    observed = ObservedFaces.of(faces, mask, inradius)
    known = np.isfinite(accepted[..., 0]) & np.isnan(result.refuted[..., 0])
    for unseen in unseen_faces(observed, known, field, mask, inradius):
        result.normals[unseen.pixels] = unseen.normal
        result.weights[unseen.pixels] = UNSEEN_WEIGHT
        result.spread[unseen.pixels] = unseen.spread
    for face, residual in reversed(list(zip(faces, _crease_residuals(observed), strict=True))):
        result.normals[face.hull] = face.normal
        result.weights[face.hull] = FACE_WEIGHT
        result.observed[face.hull] = True
        result.spread[face.hull] = np.nan
        result.residual[face.hull] = residual
    return result


def has_other_faces(
    surface: np.ndarray, accepted: np.ndarray, lights: np.ndarray, mask: np.ndarray, inradius: float
) -> bool:
    """Return whether accepted normals show flat faces that a surface with normals `surface` (H, W, 3) has not.

    For the rest see `flat_faces`.
    """
    faces = find_faces(accepted, lights, mask, inradius)
    if not faces:
        return False
    pixels = np.any([face.pixels for face in faces], axis=0)
    if pixels.sum() < MIN_FACETED_SHARE * np.isfinite(accepted[..., 0]).sum():
        return False
    return bool(angles(surface[pixels], accepted[pixels]).mean() > MAX_FACE_ERROR_DEG)


def _tested(
    faces: list[Face], candidates: np.ndarray, mask: np.ndarray, inradius: float
) -> tuple[list[Face], list[Face]]:
    """Return the faces that stand the test of their edges, and those that do not.

    No face is refuted unless another shows that edges of this object are rounded enough to be seen.
    """
    edges = [edge for edge in face_edges(faces, mask, inradius) if edge.behind != SILHOUETTE]
    evidence = [
        rounding_evidence([edge for edge in edges if edge.face == number], face, candidates, inradius)
        for number, face in enumerate(faces)
    ]
    is_rounded = any(share >= ROUNDED_SHARE and length >= MIN_TESTED_INRADII * inradius for share, length in evidence)
    fails = [
        is_rounded and share < CUT_OFF_SHARE and length >= MIN_TESTED_INRADII * inradius for share, length in evidence
    ]
    kept = [face for face, failed in zip(faces, fails, strict=True) if not failed]
    return kept, [face for face, failed in zip(faces, fails, strict=True) if failed]


def _crease_residuals(observed: ObservedFaces) -> list[float]:
    """Return the RMS residual of each face's creases with other faces, NaN with fewer than two independent ones."""
    faces, between = observed.faces, creases(observed.edges)
    result = []
    for number, face in enumerate(faces):
        own = [(pair, along) for pair, along in between.items() if number in pair]
        directions = np.array([crease_direction(along, face.normal) for _, along in own]).reshape(-1, 3)
        turns = np.abs(directions @ directions.T) < np.cos(np.radians(MIN_CREASE_TURN_DEG))
        squares = [crease_residual(along, faces[a].normal, faces[b].normal) ** 2 for (a, b), along in own]
        result.append(float(np.sqrt(np.mean(squares))) if turns.any() else float("nan"))
    return result
