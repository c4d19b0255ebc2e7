"""Labels: which clusters are the exterior surface, and the normals of every pixel, by the chosen method."""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.perspective import rotate_from_view, rotate_to_view
from glint.tasks.algorithms.labelling.dual_layer import reconstruct_dual_layer
from glint.tasks.algorithms.labelling.reconstruction import (
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    PROVENANCE,
    Reconstruction,
    reconstruct_normals,
)
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
            "rounds": [{"exterior": each.exterior, "changed": each.changed} for each in found.rounds],
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
        seen = None if expected is None else rotate_to_view(expected, view)
        clusters, marks = faced(clusters, view), faced_marks(marks, view)
        found = reconstruct(clusters, mask, rotate_to_view(initial, view), marks, parameters, seen)
        return replace(
            found, normals=rotate_from_view(found.normals, view), initial=rotate_from_view(found.initial, view)
        )
    chosen, outline = parameters.labels, parameters.silhouette
    if chosen.method == "paper":
        return reconstruct_dual_layer(clusters, mask, initial, marks=marks, edges=chosen.edges, weight=chosen.weight)
    if chosen.method == "winner":
        return reconstruct_winner(clusters, mask, initial, marks=marks, tension_length=outline.tension_length)
    return reconstruct_normals(
        clusters,
        mask,
        marks=marks,
        expected=expected,
        rounds=chosen.rounds,
        strength=chosen.strength,
        contrast=chosen.contrast,
        prior=chosen.prior,
        shape_weight=chosen.shape_weight,
        rim_weight=outline.rim_weight,
        tension_length=outline.tension_length,
    )
