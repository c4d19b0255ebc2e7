"""Ablation: the errors with each ingredient of the labelling switched off, on stored clusters."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.candidates.shading import without_shading
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.perspective import rotate_to_view
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.weights import FieldError, FieldWeights, GraphCutWeights
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import faced, load_clusters
from glint.tasks.stages.labels import has_readmission
from glint.tasks.stages.markup import faced_marks, load_marks

ABLATIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "default": {},
        "no symmetry": {"symmetry": False},
        "no flat faces": {"flat_faces": False},
        "no shape evidence": {"graph_cut_weights": GraphCutWeights(shape_weight=0.0)},
        "no ties between neighbours": {"graph_cut_weights": GraphCutWeights(strength=0.0)},
        "every accepted normal pulls": {"min_confidence": 0.0},
        "one round": {"max_iterations": 1},
        "no tension": {"field_weights": FieldWeights(tension_length=100.0)},
        "spread that does not grow": {"field_error": FieldError(slope=0.0)},
        "rim as weak as a normal": {"field_weights": FieldWeights(rim=0.1)},
        "nothing readmitted": {"readmission": False},
        "dark pixels not bent": {"field_weights": FieldWeights(unreached=0.0)},
        "no evidence of shading": {"graph_cut_weights": GraphCutWeights(shading_weight=0.0)},
        "shading taken for highlights": {"without_shading": False},
        "two candidates": {"clusters": 2},
        "one candidate": {"clusters": 1},
        "no marks": {"marks": False},
    }
)
"""Parameters of `reconstruct_normals` that switch an ingredient off; `clusters`: candidates that are left."""


def ablate(work: CaptureContext) -> dict[str, tuple[float, float]] | None:
    """Return squared errors over observed region and whole mask, by ingredient switched off; None without true normals.

    Raises:
        InputError: the truth is unusable; StoreError: the capture was not run.
    """
    if work.capture.truth is None:
        return None
    mask = work.load("mask").read("mask")
    truth = read_truth(work.capture.truth, mask.shape).normals
    if truth is None:
        return None
    clusters, marks, geometry = load_clusters(work), load_marks(work), load_geometry(work)
    view = geometry.view_vectors
    clusters, marks, truth = faced(clusters, view), faced_marks(marks, view), rotate_to_view(truth, view)
    observed = mask & (clusters.observations > 0)
    given = {"readmission": has_readmission(work.capture.pose), "camera": geometry.region_camera}
    results = {}
    for name, parameters in ABLATIONS.items():
        if name == "no marks" and marks is None:
            continue
        settings: dict[str, Any] = {**given, **parameters}
        normals = _labelled_normals(clusters, mask, marks, settings)
        results[name] = squared_errors(normals, truth, observed), squared_errors(normals, truth, mask)
    return results


def _labelled_normals(
    clusters: Clusters, mask: np.ndarray, marks: Marks | None, parameters: dict[str, Any]
) -> np.ndarray:
    """Return the normals (H, W, 3) that the labelling gives with these parameters, see ABLATIONS."""
    if parameters.pop("without_shading", True):
        clusters = without_shading(clusters)
    kept = clusters.normals[: parameters.pop("clusters", None)]
    if not parameters.pop("marks", True):
        marks = None
    result = reconstruct_normals(
        replace(clusters, normals=kept, shading=clusters.shading[: len(kept)]),
        mask,
        marks=marks,
        **parameters,
    )
    return result.normals
