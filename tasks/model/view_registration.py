"""The views of one object from its captures' stored results: read, registered, and relabelled with a model."""

from collections.abc import Mapping, Sequence

import numpy as np

from glint.tasks.algorithms.geometry.perspective import areal_focal_length
from glint.tasks.algorithms.labelling.confidence import probability_within_tolerance
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.raycast import expected_normals
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import SilhouetteMask, View
from glint.tasks.algorithms.registration.registered_views import (
    RegisteredViews,
    register_by_matrices,
    register_on_turntable,
)
from glint.tasks.algorithms.registration.unposed_views import register_unposed
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.labels import load_view, reconstruct

RELABELLING_ROUNDS = 3
"""Iterations of a labelling that starts from the model's normals, nearly right already; the next pass continues it."""


def view_of(work: CaptureContext, sphere_doubts: Sequence[StageWarning] = ()) -> View:
    """Read a capture's mask, normals and confidence as a view, with the pose and the camera of the catalogue.

    A pose that is not given as a matrix is left at the identity: registration sets it.

    sphere_doubts: warnings of spheres that contradict the other captures' spheres: its normals count less by them.
    """
    labels, geometry = work.load("labels"), load_geometry(work)
    confidence, evidence = labels.read("confidence"), labels.read("evidence")
    pixel_size = geometry.pixel_size or 1.0
    pose, camera = work.capture.pose, geometry.camera
    turned = np.radians(max((doubt.cost_deg for doubt in sphere_doubts), default=0.0))
    trust = np.divide(confidence, evidence, out=np.zeros_like(evidence), where=evidence > 0.0)
    # A turntable's axis is at the distance where a pixel covers pixel_size.
    depth = 0.0 if camera is None else -pixel_size * areal_focal_length(camera)
    view = View(
        name=work.capture.id,
        silhouette=SilhouetteMask(work.load("mask").read("mask")),
        normals=labels.read("normals"),
        evidence=evidence,
        rotation=np.eye(3),
        translation=np.array([0.0, 0.0, depth]),
        origin=(geometry.region.x, geometry.region.y),
        frame=geometry.frame_size,
        pixel_size=pixel_size,
        matrix=camera,
        trust=trust * probability_within_tolerance(turned),
    )
    if pose is None or pose.camera_to_world is None:
        return view
    return view.with_camera_to_world(np.array(pose.camera_to_world, float))


def register_views(
    works: Mapping[str, CaptureContext], sphere_doubts: Mapping[str, Sequence[StageWarning]]
) -> RegisteredViews:
    """Register the captures with a pose, then those without one on a coarse model of these.

    works: by capture id; sphere_doubts: likewise, see `view_of`.

    Raises:
        UnusableCapture: fewer than two views have a pose, or none agree.
    """
    poses = {name: work.capture.pose for name, work in works.items()}
    angles = {name: pose.turntable for name, pose in poses.items() if pose is not None and pose.turntable is not None}
    posed = [
        view_of(works[name], sphere_doubts.get(name, ()))
        for name in poses
        if poses[name] is not None and name not in angles
    ]
    on_table = [view_of(works[name], sphere_doubts.get(name, ())) for name in angles]
    registered = (
        register_on_turntable(on_table, list(angles.values()), posed) if angles else register_by_matrices(posed)
    )
    unposed = [view_of(works[name], sphere_doubts.get(name, ())) for name, pose in poses.items() if pose is None]
    return register_unposed(registered, unposed, coarse_model(registered.views)) if unposed else registered


def relabelled(view: View, model: Model, work: CaptureContext) -> View:
    """Return a view whose highlights are labelled with the model's normals in place of the silhouette's smooth field.

    Views labelled by another method than "sheets", or in whose direction the model is not seen at all, are unchanged.
    """
    expected = expected_normals(model, view)
    if work.parameters.labels.method != "sheets" or not np.isfinite(expected[view.mask]).all():
        return view
    parameters = work.parameters.labels
    fewer_rounds = parameters.model_copy(update={"rounds": min(parameters.rounds, RELABELLING_ROUNDS)})
    labels = reconstruct(load_view(work), fewer_rounds, work.parameters.silhouette, expected=expected)
    return view.with_normals(labels.normals, labels.confidence)
