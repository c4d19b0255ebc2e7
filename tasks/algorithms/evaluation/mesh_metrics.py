"""Errors of a model against the true surface: accuracy, completeness, chamfer distance, F-score, normal consistency.

Defined as in benchmarks of multi-view reconstruction: accuracy and completeness after Seitz et al., CVPR 2006; the
F-score after Knapitsch et al., Tanks and Temples, ACM TOG 2017. Means are taken over points sampled from both surfaces.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

SURFACE_SAMPLES = 100_000
"""Points that are sampled from either surface."""
F_SCORE_DISTANCES = (0.005, 0.01)
"""Thresholds of the F-scores, as shares of the diagonal of the true bounding box."""


@dataclass(frozen=True, slots=True)
class ModelScore:
    """Distances are shares of the diagonal of the true bounding box.

    accuracy: mean distance from the model to the truth; completeness: from the truth to the model; chamfer: mean of the
    two; f_scores: harmonic means of precision and recall at F_SCORE_DISTANCES; normals: mean cosine between normals at
    nearest points (normal consistency); watertight: whether the model's mesh is closed.
    """

    accuracy: float
    completeness: float
    chamfer: float
    f_scores: tuple[float, ...]
    normals: float
    watertight: bool


def score_model(
    vertices: np.ndarray, triangles: np.ndarray, truth: trimesh.Trimesh, samples: int = SURFACE_SAMPLES
) -> ModelScore:
    """Score a mesh against the true one, in the same frame and unit.

    vertices (N, 3), triangles (M, 3); samples: points drawn uniformly from each surface, with fixed seeds.
    """
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    model_points, model_faces = trimesh.sample.sample_surface(mesh, samples, seed=0)
    true_points, true_faces = trimesh.sample.sample_surface(truth, samples, seed=1)
    diagonal = float(np.linalg.norm(np.ptp(truth.vertices, axis=0)))
    to_truth, nearest = cKDTree(true_points).query(model_points)
    to_model = cKDTree(model_points).query(true_points)[0]
    f_scores = []
    for share in F_SCORE_DISTANCES:
        precision, recall = float((to_truth < share * diagonal).mean()), float((to_model < share * diagonal).mean())
        f_scores.append(2 * precision * recall / max(precision + recall, 1e-12))
    cosine = (mesh.face_normals[model_faces] * truth.face_normals[true_faces[nearest]]).sum(axis=1)
    return ModelScore(
        accuracy=float(to_truth.mean() / diagonal),
        completeness=float(to_model.mean() / diagonal),
        chamfer=float((to_truth.mean() + to_model.mean()) / 2 / diagonal),
        f_scores=tuple(f_scores),
        normals=float(cosine.mean()),
        watertight=bool(mesh.is_watertight),
    )
