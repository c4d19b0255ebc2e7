"""Stage model: one closed surface, in world coordinates, from all views of an object (the paper's future work)."""

from collections.abc import Sequence
from dataclasses import replace

from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import REFINEMENT_ROUNDS, STEPS_PER_ROUND, reconstruct_surface
from glint.tasks.algorithms.registration.registered_views import refine
from glint.tasks.algorithms.registration.view_rejection import RejectedView
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import Progress, StageOutput, StageRecord, load_or_compute, no_progress
from glint.tasks.model.base_plane import base_plane
from glint.tasks.model.model_key import STAGE, VERSION
from glint.tasks.model.model_output import model_output
from glint.tasks.model.model_unit import checked_unit, unit_of_model
from glint.tasks.model.pose_doubts import doubted_model
from glint.tasks.model.same_videos import same_video_warnings, with_same_videos
from glint.tasks.model.view_registration import register_views, relabelled
from glint.tasks.sphere_agreement import deviating_spheres, surveyed_spheres


def labelled(works: Sequence[CaptureContext]) -> list[CaptureContext]:
    """Return the captures whose labels are stored."""
    return [work for work in works if work.repository.stage_key(work.capture.id, "labels", work.ref) is not None]


def perform_model(works: Sequence[CaptureContext], key: str, progress: Progress | None = None) -> StageRecord:
    """Compute and save the model of an object's captures, unless it is stored under its key already.

    Raises:
        UnusableCapture: the views do not fit together; StoreError: the store fails.
    """
    first = works[0]
    facts = {"parameters": first.parameters.model.model_dump(mode="json"), "versions": {STAGE: VERSION}}
    return load_or_compute(first, WHOLE_OBJECT, STAGE, key, facts, lambda: model(works, progress or no_progress))


def model(works: Sequence[CaptureContext], progress: Progress) -> StageOutput:
    """Register the views, reconstruct a surface, relabel each view with the surface's normals, and reconstruct again.

    A turntable's angles are refined on a first, coarse surface and again on each better one. The normals compared are
    always those of the views' own labels: labels derived from the model would confirm its errors.

    Raises:
        UnusableCapture: the views do not fit together, or their matrices are in another unit.
    """
    usable = labelled(works)
    by_name = {work.capture.id: work for work in usable}
    unit = unit_of_model(usable)
    unlabelled = [
        RejectedView(work.capture.id, "it has no labels", remedy="see what is wrong with that capture")
        for work in works
        if work not in usable
    ]
    sphere_doubts = deviating_spheres(surveyed_spheres(usable))
    same_videos = same_video_warnings(usable)
    try:
        registered = register_views(by_name, sphere_doubts)
    except UnusableCapture as error:
        raise with_same_videos(error, same_videos) from error
    registered = replace(registered, rejected=(*registered.rejected, *unlabelled))
    unit, unit_warnings = checked_unit(registered, unit)
    parameters = works[0].parameters.model
    base = base_plane(registered, parameters.base_plane)
    surface: Model | None = None
    views = list(registered.views)
    for number in range(parameters.passes):
        if surface is not None:
            views = [relabelled(view, surface, by_name[view.name]) for view in registered.views]
        for round_number in range(REFINEMENT_ROUNDS):
            if surface is not None:
                registered = refine(registered, surface)
                views = [
                    view.with_pose(posed.rotation, posed.translation)
                    for view, posed in zip(views, registered.views, strict=True)
                ]
            part = _part_of(progress, number * REFINEMENT_ROUNDS + round_number, parameters.passes)
            surface = reconstruct_surface(views, surface, rounds=1, progress=part, base=base.height)
    assert surface is not None
    surface, pose_doubts = doubted_model(surface, views, registered, parameters.most_triangles)
    output = model_output(registered, surface, unit, sphere_doubts, base, pose_doubts)
    return replace(output, warnings=[*output.warnings, *unit_warnings, *same_videos])


def _part_of(progress: Progress, rounds_done: int, passes: int) -> Progress:
    """Return the progress of one round as part of all rounds of all passes."""
    total = STEPS_PER_ROUND * REFINEMENT_ROUNDS * passes
    return lambda done, _: progress(STEPS_PER_ROUND * rounds_done + done, total)
