"""Silhouette: rim and initial normals from the mask, with marked highlights as constraints."""

from glint.tasks.algorithms.geometry.perspective import rotate_from_view
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import views_of
from glint.tasks.stages.markup import faced_marks, load_marks


def silhouette(work: Workspace, progress: Progress) -> Outcome:
    """Rim pixels and the smooth field of initial normals."""
    parameters, view, marks = work.parameters.silhouette, views_of(work), load_marks(work)
    found = initial_normals(
        work.load("mask").read("mask"),
        marks=marks if view is None else faced_marks(marks, view),
        contour_weight=parameters.rim_weight,
        tension_length=parameters.tension_length,
    )
    initial = found.normals if view is None else rotate_from_view(found.normals, view)
    return Outcome(arrays={"rim": found.contour, "initial": initial}, counts={"rim pixels": int(found.contour.sum())})
