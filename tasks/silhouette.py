"""Silhouette: rim and initial normals from the mask, with marked highlights as constraints."""

from tasks.algorithms.perspective import in_camera
from tasks.algorithms.silhouette import initial_normals
from tasks.frames import views_of
from tasks.markup import faced_marks, load_marks
from tasks.stage import Outcome, Progress
from tasks.workspace import Workspace


def silhouette(work: Workspace, progress: Progress) -> Outcome:
    """Rim pixels and the smooth field of initial normals."""
    parameters, view, marks = work.parameters.silhouette, views_of(work), load_marks(work)
    found = initial_normals(
        work.load("mask").read("mask"),
        marks=marks if view is None else faced_marks(marks, view),
        rim_weight=parameters.rim_weight,
        tension_length=parameters.tension_length,
    )
    initial = found.initial if view is None else in_camera(found.initial, view)
    return Outcome(arrays={"rim": found.rim, "initial": initial}, counts={"rim pixels": int(found.rim.sum())})
