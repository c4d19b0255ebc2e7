"""Silhouette: rim and initial normals from the mask, with marked highlights as constraints."""

from tasks.algorithms.silhouette import initial_normals
from tasks.markup import load_marks
from tasks.stage import Outcome, Progress
from tasks.workspace import Workspace


def silhouette(work: Workspace, progress: Progress) -> Outcome:
    """Rim pixels and the smooth field of initial normals."""
    parameters = work.parameters.silhouette
    found = initial_normals(
        work.load("mask").read("mask"),
        marks=load_marks(work),
        rim_weight=parameters.rim_weight,
        tension_length=parameters.tension_length,
    )
    return Outcome(arrays={"rim": found.rim, "initial": found.initial}, counts={"rim pixels": int(found.rim.sum())})
