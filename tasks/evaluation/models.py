"""Evaluate: an object's model against the true surface, beside the visual hull and merging that solves no offsets."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from glint.storage.catalogue.loading import Object
from glint.storage.errors import InputError
from glint.storage.locations.input_files import locate, read_bytes
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.evaluation.mesh_metrics import ModelScore, score_model
from glint.tasks.algorithms.multiview.depth_sampling import merge_depths, shifted_to
from glint.tasks.algorithms.multiview.reconstruction import Model, visual_hull
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import outline_of
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.stages.model import STAGE, view_of

METHODS = ("visual hull", "depths shifted to the hull", "glint")
_MODEL_BYTES = 2_000_000_000


@dataclass(frozen=True, slots=True)
class ModelEvaluation:
    """An object's model against the truth: scores of METHODS; views in it and left out; triangles; seconds."""

    name: str
    scores: dict[str, ModelScore]
    views: int
    left_out: tuple[str, ...]
    triangles: int
    seconds: float


def evaluate_model(entry: Object, works: Sequence[Workspace]) -> ModelEvaluation | None:
    """Judge the stored model of an object's captures; None where there is no model or no truth.

    Raises:
        InputError: the true model cannot be read.
    """
    repository = works[0].repository
    if entry.truth_model is None or repository.stage_key(WHOLE_OBJECT, STAGE) is None:
        return None
    truth = true_mesh(entry.truth_model)
    saved = repository.load(WHOLE_OBJECT, STAGE)
    views, depths = merged_views(works)
    hull = visual_hull(views, [outline_of(view.mask) for view in views])
    shifted = [shifted_to(hull, view, depth) for view, depth in zip(views, depths, strict=True)]
    naive = merge_depths([believed(view) for view in views], shifted, hull.cell)
    scores = {
        "visual hull": score(hull, truth),
        "depths shifted to the hull": score(naive, truth),
        "glint": score_model(saved.read("vertices"), saved.read("triangles"), truth),
    }
    return ModelEvaluation(
        name=entry.id,
        scores=scores,
        views=len(views),
        left_out=tuple(each["name"] for each in saved.record["left_out"]),
        triangles=int(saved.arrays["triangles"].shape[0]),
        seconds=float(saved.record["seconds"]),
    )


def merged_views(works: Sequence[Workspace]) -> tuple[list[View], list[np.ndarray]]:
    """The views of the stored model of these captures, with their stored labels and the poses that it gave them, and
    their own depth maps (H, W), world units."""
    by_name = {work.capture.id: work for work in works}
    views, depths = [], []
    for said in works[0].repository.load(WHOLE_OBJECT, STAGE).record["views"]:
        work = by_name[said["capture"]]
        matrix = np.array(said["camera_to_world"])
        views.append(view_of(work).placed(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3]))
        depths.append(work.load("depth").read("depth"))
    return views, depths


def believed(view: View) -> View:
    """The view's normals where they are steep are the rim's guess; they would only thicken the merged surface."""
    return replace(view, mask=view.mask & (np.nan_to_num(view.normals[..., 2]) > 0.25))


def score(model: Model, truth: trimesh.Trimesh) -> ModelScore:
    """Score a model against the true surface."""
    return score_model(model.vertices, model.triangles, truth)


def true_mesh(address: str) -> trimesh.Trimesh:
    """Read a true surface.

    Raises:
        InputError: it cannot be read.
    """
    place = locate(address)
    try:
        mesh = trimesh.load(io.BytesIO(read_bytes(place, _MODEL_BYTES)), file_type=place.name.rpartition(".")[2])
    except (ValueError, KeyError, IndexError, NotImplementedError) as error:
        raise InputError(f"the true model {place.uri} cannot be read ({error})", "give a PLY file") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"the true model {place.uri} has no triangles", "give a mesh as a PLY file")
    return mesh
