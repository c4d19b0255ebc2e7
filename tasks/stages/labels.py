"""Labels: which clusters are the exterior surface, and the normals of every pixel, by the chosen method."""

from dataclasses import dataclass, replace

import numpy as np

from glint.storage.catalogue.models import Pose
from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.candidates.shading import MAX_SHADING, without_shading
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import rotate_from_view, rotate_to_view, view_vectors
from glint.tasks.algorithms.labelling.confidence import with_input_doubt
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.results import (
    CONFIDENT,
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    PROVENANCE,
    BodyWall,
    Reconstruction,
    exterior_normals,
)
from glint.tasks.algorithms.labelling.weights import FieldWeights, GraphCutWeights, LabellingOptions
from glint.tasks.algorithms.near_light.half_vector_error import combined_error, spheres_error
from glint.tasks.algorithms.published.dual_layer import reconstruct_dual_layer
from glint.tasks.algorithms.published.winner_takes_all import reconstruct_winner
from glint.tasks.algorithms.sheets.light_evidence import light_evidence
from glint.tasks.engine.parameters import LabelsParameters, SilhouetteParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.stages.camera_doubt import CameraDoubt, doubt_camera, doubt_given_camera
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import faced, load_clusters
from glint.tasks.stages.light_doubt import LightDoubt, doubt_lights
from glint.tasks.stages.lights import FILE
from glint.tasks.stages.markup import faced_marks, load_marks
from glint.tasks.stages.wall_distance import MAX_CORRECTIONS, WallDistance, wall_distance, with_distance

CHANGED_SCENE_SHARE = 0.5
"""Share of the normals that can be trusted where a part of the frames shows another scene: of two such captures 43 and
63% of the confident ones were right."""


@dataclass(frozen=True, slots=True)
class LabelledView:
    """The view that is labelled.

    clusters: its candidates. mask: (H, W) bool. initial: (H, W, 3), the smooth normals of the silhouette. marks: None
    where nothing is marked. camera: the perspective camera's matrix (3, 3) in pixels of the region, None for parallel
    rays. Normals are in the camera frame.
    """

    clusters: Clusters
    mask: np.ndarray
    initial: np.ndarray
    marks: Marks | None
    camera: np.ndarray | None


def load_view(results: CaptureResults) -> LabelledView:
    """Load the view as it was labelled."""
    return _with_distance(results, _load_view(results), results.load("labels").record["inverse_distance_change"])


def _load_view(results: CaptureResults) -> LabelledView:
    """Load the view from what the stages before have saved."""
    return LabelledView(
        load_clusters(results),
        results.load("mask").read("mask"),
        results.load("silhouette").read("initial"),
        load_marks(results),
        load_geometry(results).region_camera,
    )


def _with_distance(results: CaptureResults, view: LabelledView, change: float) -> LabelledView:
    """Return the view as it is with another inverse distance of the light, changed by so much, 1/pixels."""
    clusters, marks = with_distance(view.clusters, view.marks, load_geometry(results), change)
    return replace(view, clusters=clusters, marks=marks)


def labels(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Label the candidates: labels, normals, their provenance and confidence."""
    view, result, distance = _labelled(inputs)
    light_doubt = _light_doubt(inputs, view.clusters, result.labels)
    camera_doubt = _camera_doubt(inputs, view.clusters, result.labels)
    confidence = _confidence(inputs, view.mask, result, light_doubt, camera_doubt, distance)
    names = {PROVENANCE[code]: int((result.provenance == code).sum()) for code in (OBSERVED, MARKED, FILLED)}
    confident = float((confidence[result.provenance != OUTSIDE] >= CONFIDENT).mean())
    return StageOutput(
        arrays={
            "labels": result.labels,
            "normals": result.normals,
            "provenance": result.provenance,
            "confidence": confidence,
            "evidence": result.confidence.astype(np.float32),
        }
        | ({} if result.body_depth is None else {"body_depth": result.body_depth}),
        record={
            "provenance": list(PROVENANCE),
            "rounds": [
                {"exterior": iteration.exterior, "changed": iteration.changed} for iteration in result.iterations
            ],
            "inverse_distance_change": 0.0 if distance is None else distance.change,
        },
        counts={f"{name} pixels": count for name, count in names.items()} | {"confident share": round(confident, 4)},
        warnings=[*light_doubt.warnings, *camera_doubt.warnings, *(() if distance is None else distance.warnings)],
    )


def _labelled(inputs: StageInputs) -> tuple[LabelledView, Reconstruction, WallDistance | None]:
    """Return the view, its reconstruction, and the light's distance by its wall, if any, for which it is corrected."""
    silhouette, readmission = inputs.parameters_of("silhouette"), has_readmission(inputs.field("pose"))
    uncorrected = view = _load_view(inputs)
    result = reconstruct(view, inputs.parameters, silhouette, readmission=readmission)
    distance, applied = wall_distance(inputs, view.clusters.normals, result, 0.0), 0.0
    for _ in range(MAX_CORRECTIONS):
        if distance is None or distance.change == applied:
            break
        applied = distance.change
        view = _with_distance(inputs, uncorrected, applied)
        result = reconstruct(view, inputs.parameters, silhouette, readmission=readmission)
        distance = wall_distance(inputs, view.clusters.normals, result, applied) or distance
    return view, result, distance and replace(distance, change=applied)


def _confidence(
    inputs: StageInputs,
    mask: np.ndarray,
    result: Reconstruction,
    light_doubt: LightDoubt,
    camera_doubt: CameraDoubt,
    distance: WallDistance | None,
) -> np.ndarray:
    """Return the confidence (H, W) float32 in normals, lowered by what may be wrong about all of them.

    mask: (H, W) bool.
    """
    half_vector_sd = inputs.load("lights").read("half_vector_sd")
    if distance is not None:
        half_vector_sd = np.sqrt(np.maximum(np.square(half_vector_sd) + distance.variance_change, 0.0))
    spheres_sd = spheres_error(load_geometry(inputs).spheres, np.where(mask, result.normals[..., 2], 1.0))
    lights_sd = np.full(half_vector_sd.shape, light_doubt.half_vector_sd)
    shared_sd = combined_error([half_vector_sd, spheres_sd, camera_doubt.half_vector_sd, lights_sd])
    # Highlights of two scenes belong to two surfaces.
    is_one_scene = inputs.load("survey").record["scene_change"] is None
    trusted_share = light_doubt.share if is_one_scene else CHANGED_SCENE_SHARE * light_doubt.share
    return with_input_doubt(trusted_share * result.confidence, shared_sd, inputs.load("mask").read("doubt"))


def _light_doubt(inputs: StageInputs, clusters: Clusters, labels: np.ndarray) -> LightDoubt:
    """Return the doubt about lights of an `.lp` file; those that the spheres show have the axes of the video."""
    lights = inputs.load("lights")
    if lights.record["source"] != FILE:
        return LightDoubt()
    mask, view = inputs.load("mask").read("mask"), load_geometry(inputs).view_vectors
    candidates = rotate_to_view(clusters.normals, view)
    expected = rotate_to_view(inputs.load("silhouette").read("initial"), view)
    observed = mask & (clusters.observations > 0)
    count = int(np.isfinite(lights.read("half_vectors")[:, 0]).sum())
    return doubt_lights(light_evidence(candidates, labels, expected, observed, inradius_of(mask)), count)


def _camera_doubt(inputs: StageInputs, clusters: Clusters, labels: np.ndarray) -> CameraDoubt:
    """Return the doubt about a camera whose matrix is given, or that the spheres do not show."""
    record, geometry = inputs.load("lights").record, load_geometry(inputs)
    normals, spheres_sd = exterior_normals(clusters.normals, labels), float(record["spheres_error"])
    if geometry.camera is not None and geometry.spheres:
        return doubt_given_camera(geometry, normals, spheres_sd)
    if record["camera"] is None:
        return CameraDoubt(np.zeros(normals.shape[:2], np.float32))
    return doubt_camera(geometry, record["camera"], normals, spheres_sd)


def reconstruct(
    view: LabelledView,
    parameters: LabelsParameters,
    silhouette: SilhouetteParameters,
    *,
    expected: np.ndarray | None = None,
    readmission: bool = True,
) -> Reconstruction:
    """Reconstruct the normals of one view by the method that `parameters` names.

    Under a perspective camera each pixel's normals are labelled as seen along its own ray. expected: normals (H, W, 3)
    of a model of all views, for the method `sheets`. readmission: of the method `sheets`, see `has_readmission`.
    """
    mask = view.mask
    rays = None if view.camera is None else view_vectors(view.camera, mask.shape, 0.0, 0.0)
    expected = None if expected is None else rotate_to_view(expected, rays)
    clusters, marks, initial = (
        faced(view.clusters, rays),
        faced_marks(view.marks, rays),
        rotate_to_view(view.initial, rays),
    )
    if parameters.method == "paper":
        result = reconstruct_dual_layer(
            clusters, mask, initial, marks=marks, connectivity=parameters.edges, weight=parameters.weight
        )
        # The literal baseline keeps its candidates, but no confidence in those that show shading.
        shaded = ((result.labels > 0) & (clusters.shading > MAX_SHADING)).any(axis=0)
        result = replace(result, confidence=np.where(shaded, np.float32(0.0), result.confidence))
    elif parameters.method == "winner":
        filling = FieldWeights(tension_length=silhouette.tension_length)
        result = reconstruct_winner(without_shading(clusters), mask, initial, marks=marks, field_weights=filling)
    else:
        result = reconstruct_normals(
            without_shading(clusters),
            mask,
            labelling_options(parameters, silhouette, readmission),
            marks=marks,
            expected=expected,
            camera=view.camera,
        )
    wall = result.wall
    if wall is not None:
        wall = BodyWall(rotate_from_view(wall.normals, rays), rotate_from_view(wall.tangents, rays))
    return replace(
        result,
        normals=rotate_from_view(result.normals, rays),
        initial=rotate_from_view(result.initial, rays),
        wall=wall,
    )


def has_readmission(pose: Pose | None) -> bool:
    """Return whether rejected sheets are readmitted: not in a view with a pose, which other views will explain.

    A false sheet is worse there than a missing one: the model that it becomes part of labels all views again. So is a
    false contour inside the silhouette.
    """
    return pose is None


def labelling_options(
    parameters: LabelsParameters, silhouette: SilhouetteParameters, readmission: bool
) -> LabellingOptions:
    """Return the options of the method `sheets` that parameters give; readmission: see `has_readmission`."""
    return LabellingOptions(
        GraphCutWeights(parameters.strength, parameters.contrast, parameters.prior, parameters.shape_weight),
        FieldWeights(rim=silhouette.rim_weight, tension_length=silhouette.tension_length),
        readmission=readmission,
        inner_contours=readmission,
        max_iterations=parameters.rounds,
    )
