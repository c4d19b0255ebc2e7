"""A model against the true surface: distances both ways, as benchmarks of reconstruction have them."""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

SAMPLES = 100_000
WITHIN = (0.005, 0.01)
"""Distances, as shares of the true bounding box's diagonal, within which a point counts as right."""


@dataclass(frozen=True, slots=True)
class ModelScore:
    """Distances as shares of the true diagonal: `accuracy` from the model to the truth, `completeness` back, `chamfer`
    their mean; `f_scores` at WITHIN; `normals` mean cosine at nearest points; `watertight`."""

    accuracy: float
    completeness: float
    chamfer: float
    f_scores: tuple[float, ...]
    normals: float
    watertight: bool


def score_model(
    vertices: np.ndarray, triangles: np.ndarray, truth: trimesh.Trimesh, samples: int = SAMPLES
) -> ModelScore:
    """Score a mesh, vertices (N, 3) and triangles (M, 3), against the true one, by points drawn evenly from both."""
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    found, found_faces = trimesh.sample.sample_surface(mesh, samples, seed=0)
    true, true_faces = trimesh.sample.sample_surface(truth, samples, seed=1)
    diagonal = float(np.linalg.norm(np.ptp(truth.vertices, axis=0)))
    to_truth, nearest = cKDTree(true).query(found)
    to_model = cKDTree(found).query(true)[0]
    scores = []
    for share in WITHIN:
        right, covered = float((to_truth < share * diagonal).mean()), float((to_model < share * diagonal).mean())
        scores.append(2 * right * covered / max(right + covered, 1e-12))
    cosine = (mesh.face_normals[found_faces] * truth.face_normals[true_faces[nearest]]).sum(axis=1)
    return ModelScore(
        accuracy=float(to_truth.mean() / diagonal),
        completeness=float(to_model.mean() / diagonal),
        chamfer=float((to_truth.mean() + to_model.mean()) / 2 / diagonal),
        f_scores=tuple(scores),
        normals=float(cosine.mean()),
        watertight=bool(mesh.is_watertight),
    )
