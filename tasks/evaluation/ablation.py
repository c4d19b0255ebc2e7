"""Ablation: the errors with each ingredient of the labelling switched off, on stored clusters.

All other weights of the labelling are the default ones, whatever the parameters of the capture.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from glint.tasks.algorithms.candidates.shading import without_shading
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.perspective import rotate_to_view
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.weights import (
    DEFAULT_OPTIONS,
    FieldError,
    FieldWeights,
    GraphCutWeights,
    LabellingOptions,
)
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.evaluation.truth import load_truth
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import faced, load_clusters
from glint.tasks.stages.labels import has_readmission
from glint.tasks.stages.markup import faced_marks, load_marks


@dataclass(frozen=True, slots=True)
class Ablation:
    """A labelling that lacks an ingredient.

    options: of the labelling; candidates: the first of a pixel that are left, None for all; keeps_shading: whether
    candidates that show shading stay; has_marks: whether marks are read.
    """

    options: LabellingOptions = DEFAULT_OPTIONS
    candidates: int | None = None
    keeps_shading: bool = False
    has_marks: bool = True


ABLATIONS: Mapping[str, Ablation] = MappingProxyType(
    {
        "default": Ablation(),
        "no symmetry": Ablation(LabellingOptions(symmetry=False)),
        "no flat faces": Ablation(LabellingOptions(flat_faces=False)),
        "no shape evidence": Ablation(LabellingOptions(graph_cut=GraphCutWeights(shape_weight=0.0))),
        "no ties between neighbours": Ablation(LabellingOptions(graph_cut=GraphCutWeights(strength=0.0))),
        "every accepted normal pulls": Ablation(LabellingOptions(min_confidence=0.0)),
        "one round": Ablation(LabellingOptions(max_iterations=1)),
        "no tension": Ablation(LabellingOptions(field=FieldWeights(tension_length=100.0))),
        "spread that does not grow": Ablation(LabellingOptions(field_error=FieldError(slope=0.0))),
        "rim as weak as a normal": Ablation(LabellingOptions(field=FieldWeights(rim=0.1))),
        "nothing readmitted": Ablation(LabellingOptions(readmission=False)),
        "dark pixels not bent": Ablation(LabellingOptions(field=FieldWeights(unreached=0.0))),
        "no contours inside the silhouette": Ablation(LabellingOptions(inner_contours=False)),
        "no evidence of shading": Ablation(LabellingOptions(graph_cut=GraphCutWeights(shading_weight=0.0))),
        "shading taken for highlights": Ablation(keeps_shading=True),
        "two candidates": Ablation(candidates=2),
        "one candidate": Ablation(candidates=1),
        "no marks": Ablation(has_marks=False),
    }
)
"""What switches an ingredient off."""


def ablate(work: CaptureContext) -> dict[str, tuple[float, float]] | None:
    """Return squared errors over observed region and whole mask, by ingredient switched off; None without true normals.

    Raises:
        InputError: the truth is unusable; StoreError: the capture was not run.
    """
    if work.capture.truth is None:
        return None
    mask = work.load("mask").read("mask")
    truth = load_truth(work, mask.shape)
    if truth is None:
        return None
    clusters, marks, geometry = load_clusters(work), load_marks(work), load_geometry(work)
    view = geometry.view_vectors
    clusters, marks, true_normals = faced(clusters, view), faced_marks(marks, view), rotate_to_view(truth.normals, view)
    observed = mask & (clusters.observations > 0)
    readmission, results = has_readmission(work.capture.pose), {}
    for name, ablation in ABLATIONS.items():
        if marks is None and not ablation.has_marks:
            continue
        kept = clusters if ablation.keeps_shading else without_shading(clusters)
        count = ablation.candidates
        kept = replace(kept, normals=kept.normals[:count], shading=kept.shading[:count])
        options = replace(
            ablation.options,
            readmission=readmission and ablation.options.readmission,
            inner_contours=readmission and ablation.options.inner_contours,
        )
        known = marks if ablation.has_marks else None
        normals = reconstruct_normals(kept, mask, options, marks=known, camera=geometry.region_camera).normals
        results[name] = squared_errors(normals, true_normals, observed), squared_errors(normals, true_normals, mask)
    return results
