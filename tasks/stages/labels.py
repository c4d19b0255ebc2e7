"""Labels: which clusters are the exterior surface, and the normals of every pixel, by the chosen method."""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.perspective import facing, in_camera
from glint.tasks.algorithms.labelling.dual_layer import reconstruct_dual_layer
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.results import FILLED, MARKED, OBSERVED, OUTSIDE, PROVENANCE, Reconstruction
from glint.tasks.algorithms.labelling.weights import FieldWeights, GraphCutWeights
from glint.tasks.algorithms.labelling.winner_takes_all import reconstruct_winner
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.clusters import faced, load_clusters
from glint.tasks.stages.frames import views_of
from glint.tasks.stages.markup import faced_marks, load_marks


def labels(work: Workspace, progress: Progress) -> Outcome:
    """Labels, normals, their provenance and confidence."""
    found = reconstruct(
        load_clusters(work),
        work.load("mask").read("mask"),
        work.load("silhouette").read("initial"),
        load_marks(work),
        work.parameters,
        view=views_of(work),
    )
    names = {PROVENANCE[code]: int((found.provenance == code).sum()) for code in (OBSERVED, MARKED, FILLED)}
    sure = float((found.confidence[found.provenance != OUTSIDE] >= 0.5).mean())
    return Outcome(
        arrays={
            "labels": found.labels,
            "normals": found.normals,
            "provenance": found.provenance,
            "confidence": found.confidence,
        },
        record={
            "provenance": list(PROVENANCE),
            "rounds": [{"exterior": each.exterior, "changed": each.changed} for each in found.iterations],
        },
        counts={f"{name} pixels": count for name, count in names.items()} | {"confident share": round(sure, 4)},
    )


def reconstruct(
    clusters: Clusters,
    mask: np.ndarray,
    initial: np.ndarray,
    marks: Marks | None,
    parameters: Parameters,
    expected: np.ndarray | None = None,
    view: np.ndarray | None = None,
) -> Reconstruction:
    """Normals of one view by the method that `parameters.labels` names.

    expected: normals (H, W, 3) that a model of all views shows, for the method `sheets`. view: view vectors (H, W, 3)
    under a perspective camera; each pixel's normals are labelled as seen along its own ray.
    """
    if view is not None:
        seen = None if expected is None else facing(expected, view)
        clusters, marks = faced(clusters, view), faced_marks(marks, view)
        found = reconstruct(clusters, mask, facing(initial, view), marks, parameters, seen)
        return replace(found, normals=in_camera(found.normals, view), initial=in_camera(found.initial, view))
    chosen, outline = parameters.labels, parameters.silhouette
    if chosen.method == "paper":
        return reconstruct_dual_layer(
            clusters, mask, initial, marks=marks, connectivity=chosen.edges, weight=chosen.weight
        )
    if chosen.method == "winner":
        filling = FieldWeights(tension_length=outline.tension_length)
        return reconstruct_winner(clusters, mask, initial, marks=marks, field_weights=filling)
    return reconstruct_normals(
        clusters,
        mask,
        marks=marks,
        expected=expected,
        max_iterations=chosen.rounds,
        graph_cut_weights=GraphCutWeights(chosen.strength, chosen.contrast, chosen.prior, chosen.shape_weight),
        field_weights=FieldWeights(rim=outline.rim_weight, tension_length=outline.tension_length),
    )
