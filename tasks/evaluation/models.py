"""Evaluation of models: an object's surface against the true one, beside two baselines.

The baselines are the visual hull, and the depth maps of the single views merged without solving offsets between them.
"""

import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import trimesh

from glint.storage.catalogue.loading import Object
from glint.storage.errors import InputError
from glint.storage.locations.input_files import locate, read_bytes
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.evaluation.mesh_metrics import ModelScore, score_model
from glint.tasks.algorithms.multiview.poisson import align_depth, merge_depth_maps
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import hull_model
from glint.tasks.algorithms.registration.view_scales import scaled
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.model.model_key import STAGE
from glint.tasks.model.view_registration import view_of

MODEL_METHODS = ("visual hull", "depths shifted to the hull", "glint")
MAX_MODEL_BYTES = 2_000_000_000
"""Size of the largest true model that is read."""
MESH_FORMATS = ("ply", "stl", "obj", "off")
"""Suffixes of files that hold one mesh; others hold scenes, or need libraries that Glint does not install."""
MIN_MERGED_COSINE = 0.25
"""Cosine between normal and view axis from which a pixel's depth is merged: steeper normals are extrapolated from the
silhouette and would only thicken the merged surface."""


@dataclass(frozen=True, slots=True)
class ModelEvaluation:
    """An object's model compared with the truth.

    scores: by MODEL_METHODS, without a baseline that gives no surface; views: number of views in the model; left_out:
    names of the views that were rejected; triangles, seconds: of the stored model.
    """

    name: str
    scores: dict[str, ModelScore]
    views: int
    left_out: tuple[str, ...]
    triangles: int
    seconds: float


def evaluate_model(entry: Object, works: Sequence[CaptureContext]) -> ModelEvaluation | None:
    """Compare the stored model of an object with the truth.

    works: captures of the object. None where there is no model, no truth, or where a capture that the model is made of
    is not among `works`, as in a run of some captures only.

    Raises:
        InputError: the true model cannot be read.
    """
    repository = works[0].repository
    if entry.truth_model is None or repository.stage_key(WHOLE_OBJECT, STAGE) is None:
        return None
    saved = repository.load(WHOLE_OBJECT, STAGE)
    if not {view["capture"] for view in saved.record["views"]} <= {work.capture.id for work in works}:
        return None
    truth = load_true_mesh(entry.truth_model)
    views, depths = load_registered_views(works)
    hull = hull_model(views)
    scores = {"visual hull": score_model(hull.vertices, hull.triangles, truth)}
    aligned = [align_depth(hull, view, depth) for view, depth in zip(views, depths, strict=True)]
    with suppress(UnusableCapture):
        merged = merge_depth_maps([without_steep_normals(view) for view in views], aligned, hull.cell)
        scores["depths shifted to the hull"] = score_model(merged.vertices, merged.triangles, truth)
    scores["glint"] = score_model(saved.read("vertices"), saved.read("triangles"), truth)
    return ModelEvaluation(
        name=entry.id,
        scores=scores,
        views=len(views),
        left_out=tuple(rejected["name"] for rejected in saved.record["left_out"]),
        triangles=int(saved.arrays["triangles"].shape[0]),
        seconds=float(saved.record["seconds"]),
    )


def load_registered_views(works: Sequence[CaptureContext]) -> tuple[list[View], list[np.ndarray]]:
    """Return the views of the stored model, and their depth maps (H, W) in world units.

    works: the captures that it is made of, and perhaps others.
    The views have the poses that the model stage gave them, and the normals of their own labels.
    """
    by_name = {work.capture.id: work for work in works}
    views, depths = [], []
    for entry in works[0].repository.load(WHOLE_OBJECT, STAGE).record["views"]:
        work = by_name[entry["capture"]]
        matrix = np.array(entry["camera_to_world"])
        views.append(scaled(view_of(work), entry["scale_factor"]).with_camera_to_world(matrix))
        depths.append(work.load("depth").read("depth"))
    return views, depths


def without_steep_normals(view: View) -> View:
    """Return the view with its mask reduced to pixels whose normals are not steeper than MIN_MERGED_COSINE."""
    return view.with_mask(view.mask & (np.nan_to_num(view.normals[..., 2]) > MIN_MERGED_COSINE))


def load_true_mesh(address: str) -> trimesh.Trimesh:
    """Read a true surface.

    Raises:
        InputError: it cannot be read, or is no surface: it has no triangles, or no area.
    """
    place = locate(address)
    suffix = place.name.rpartition(".")[2].lower()
    if suffix not in MESH_FORMATS:
        raise InputError(
            f"the true model {place.uri} is not a PLY file, nor of another known format",
            f"name a file that ends in {', '.join(f'.{name}' for name in MESH_FORMATS)}",
        )
    data = read_bytes(place, MAX_MODEL_BYTES)
    try:
        mesh = trimesh.load(io.BytesIO(data), file_type=suffix)
    # The readers do not check what they read: a damaged file raises whatever error it leads to.
    except Exception as error:
        raise InputError(f"the true model {place.uri} cannot be read ({error})", "give a PLY file") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"the true model {place.uri} has no triangles", "give a mesh as a PLY file")
    if not mesh.area > 0.0:
        raise InputError(f"the true model {place.uri} has no area", "give a mesh whose triangles are not degenerate")
    return mesh
