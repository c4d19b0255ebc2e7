"""Silhouette: the occluding contour and initial normals from the mask, with marked highlights as constraints."""

from glint.tasks.algorithms.geometry.perspective import rotate_from_view
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.engine.parameters import SilhouetteParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.markup import faced_marks, load_marks


def silhouette(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find the pixels of the occluding contour and the smooth field of initial normals."""
    parameters: SilhouetteParameters = inputs.parameters
    view, marks = load_geometry(inputs).view_vectors, load_marks(inputs)
    result = initial_normals(
        inputs.load("mask").read("mask"),
        marks=faced_marks(marks, view),
        contour_weight=parameters.rim_weight,
        tension_length=parameters.tension_length,
    )
    initial = rotate_from_view(result.normals, view)
    return StageOutput(
        arrays={"rim": result.contour, "initial": initial}, counts={"rim pixels": int(result.contour.sum())}
    )
