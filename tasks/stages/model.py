"""Model: the views of one object placed and merged into one closed surface in world coordinates."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import trimesh

from glint.storage.export.image_files import encode_png
from glint.storage.inputs.digests import digest_of
from glint.storage.versions.stage_results import WHOLE_OBJECT, StoredFile
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.meshing.depth_mesh import Surface, glb_bytes, ply_bytes
from glint.tasks.algorithms.meshing.shading import draw_surface
from glint.tasks.algorithms.multiview.raycast import seen_normals
from glint.tasks.algorithms.multiview.reconstruction import ROUNDS, STEPS, Model, merge, rough_model, simplified
from glint.tasks.algorithms.multiview.registration import (
    LeftOut,
    Placed,
    place_by_matrices,
    place_on_turntable,
    place_others,
    placed_anew,
)
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.engine.capture_context import Workspace, facts_of
from glint.tasks.engine.stage import Outcome, Progress, Record, recall_or_save, silent
from glint.tasks.stages.clusters import load_clusters
from glint.tasks.stages.frames import region_of, views_of
from glint.tasks.stages.labels import reconstruct
from glint.tasks.stages.markup import load_marks
from glint.tasks.stages.surface import METRES_PER_MM

STAGE, VERSION = "model", 3
SEE_CAPTURE = "see what is wrong with that capture"
SEEN = 0.5
"""Confidence from which a part of the surface counts as known."""
AROUND = tuple(range(0, 360, 60))
"""Degrees from which the picture sheet shows the model."""


def wants_model(works: Sequence[Workspace]) -> bool:
    """Whether an object's captures are meant to be merged: there are several, and one says where it was filmed from."""
    return len(works) > 1 and any(work.capture.pose is not None for work in works)


def labelled(works: Sequence[Workspace]) -> list[Workspace]:
    """Those captures whose labels are stored."""
    return [work for work in works if work.repository.stage_key(work.capture.id, "labels") is not None]


def model_key(works: Sequence[Workspace]) -> str:
    """Digest of all that the model follows from: the captures' labels, their poses and cameras, its parameters."""
    first = works[0]
    return digest_of(
        {
            "stage": STAGE,
            "version": VERSION,
            "parameters": first.parameters.model.model_dump(mode="json"),
            "views": {
                work.capture.id: [
                    work.repository.stage_key(work.capture.id, "labels"),
                    facts_of(work.capture, ("pose", "camera", "pixel_size")),
                ]
                for work in works
            },
        }
    )


def perform_model(works: Sequence[Workspace], key: str, progress: Progress | None = None) -> Record:
    """Compute and save the model of these captures of one object, unless it is stored under its key already.

    Raises:
        UnusableCapture: the views do not fit together; StoreError: the store fails.
    """
    first = works[0]
    facts = {"parameters": first.parameters.model.model_dump(mode="json"), "versions": {STAGE: VERSION}}
    return recall_or_save(first, WHOLE_OBJECT, STAGE, key, facts, lambda: model(works, progress or silent))


def model(works: Sequence[Workspace], progress: Progress) -> Outcome:
    """Place the views, merge them, label each anew with the model as its initial field, and merge again.

    A turntable's angles are corrected by a first, rough model, and again by each better one: always by the normals that
    each view showed on its own, as those labelled by the model would confirm its mistakes.

    Raises:
        UnusableCapture: the views do not fit together.
    """
    usable = labelled(works)
    named = {work.capture.id: work for work in usable}
    unit = _unit(usable)
    missing = [LeftOut(work.capture.id, "it has no labels", remedy=SEE_CAPTURE) for work in works if work not in usable]
    placed = _placed(named)
    placed = replace(placed, left_out=(*placed.left_out, *missing))
    parameters = works[0].parameters.model
    merged: Model | None = None
    views = list(placed.views)
    for again in range(parameters.passes):
        if merged is not None:
            views = [_labelled_anew(view, merged, named[view.name]) for view in placed.views]
        for each in range(ROUNDS):
            if merged is not None:
                placed = placed_anew(placed, merged)
                views = [
                    view.placed(where.rotation, where.translation)
                    for view, where in zip(views, placed.views, strict=True)
                ]
            share = _share(progress, again * ROUNDS + each, parameters.passes)
            merged = merge(views, merged, rounds=1, progress=share)
    assert merged is not None
    if parameters.most_triangles is not None:
        merged = simplified(merged, views, parameters.most_triangles)
    return _outcome(works[0], placed, merged, unit)


def _share(progress: Progress, rounds: int, passes: int) -> Progress:
    """The progress of one round, after so many, of all rounds of all passes."""
    return lambda done, of: progress(STEPS * rounds + done, STEPS * ROUNDS * passes)


def _unit(works: Sequence[Workspace]) -> str:
    """The unit of the model, the same for all views."""
    sizes = {work.capture.id: work.load("survey").record["pixel_size"] for work in works}
    unknown = [name for name, size in sizes.items() if not size]
    if unknown and len(unknown) < len(sizes):
        raise UnusableCapture(
            f"the scale of {', '.join(unknown)} is not known, that of the other views is",
            "give pixel_size, or the diameter_mm of a sphere, for all views or for none",
        )
    return "pixels" if unknown else "mm"


def _placed(named: Mapping[str, Workspace]) -> Placed:
    """The views with a pose where they must have been, then those without where they fit a rough model of these."""
    poses = {name: work.capture.pose for name, work in named.items()}
    turning = {name: pose.turntable for name, pose in poses.items() if pose is not None and pose.turntable is not None}
    fixed = [name for name, pose in poses.items() if pose is not None and name not in turning]
    if turning and fixed:
        raise UnusableCapture(
            f"{', '.join(turning)} are given by a turntable's angle, {', '.join(fixed)} by a matrix",
            "give the poses of an object's captures all in one way",
        )
    views = [view_of(named[name]) for name in turning or fixed]
    placed = place_on_turntable(views, list(turning.values())) if turning else place_by_matrices(views)
    others = [view_of(named[name]) for name, pose in poses.items() if pose is None]
    return place_others(placed, others, rough_model(placed.views)) if others else placed


def view_of(work: Workspace) -> View:
    """What a capture's stages left, its camera where the catalogue says."""
    survey, labels, region = work.load("survey").record, work.load("labels"), region_of(work)
    pixel_size = survey["pixel_size"] or 1.0
    rotation, translation = np.eye(3), np.zeros(3)
    pose, camera = work.capture.pose, work.camera_matrix
    if pose is not None and pose.camera_to_world is not None:
        matrix = np.array(pose.camera_to_world, float)
        rotation, translation = matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3]
    elif camera is not None:
        # A turntable stands where a pixel covers pixel_size.
        translation = np.array([0.0, 0.0, -pixel_size * float(np.sqrt(camera[0, 0] * camera[1, 1]))])
    width, height = survey["frame_size"]
    return View(
        name=work.capture.id,
        mask=work.load("mask").read("mask"),
        normals=labels.read("normals"),
        confidence=labels.read("confidence"),
        rotation=rotation,
        translation=translation,
        origin=(region.x, region.y),
        frame=(width, height),
        pixel_size=pixel_size,
        matrix=camera,
    )


def _labelled_anew(view: View, merged: Model, work: Workspace) -> View:
    """The view with the highlights labelled against the model in place of the silhouette's smooth field."""
    expected = seen_normals(merged, view)
    if work.parameters.labels.method != "sheets" or not np.isfinite(expected[view.mask]).all():
        return view
    initial = work.load("silhouette").read("initial")
    clusters, marks = load_clusters(work), load_marks(work)
    found = reconstruct(clusters, view.mask, initial, marks, work.parameters, expected, views_of(work))
    return view.seeing(found.normals, found.confidence)


def _outcome(work: Workspace, placed: Placed, merged: Model, unit: str) -> Outcome:
    mesh = trimesh.Trimesh(merged.vertices, merged.triangles, process=False)
    seen = _area_share(mesh, merged.confidence >= SEEN)
    about: dict[str, Any] = {
        "unit": unit,
        "views": [_told(view, placed, merged, number) for number, view in enumerate(placed.views)],
        "left_out": [asdict(each) for each in placed.left_out],
        "turntable": None if placed.turntable is None else _turntable(placed),
        "seen": seen,
        "unseen": _area_share(mesh, merged.source < 0),
        "volume": float(mesh.volume),
        "area": float(mesh.area),
        "bounding_box": {"low": merged.vertices.min(axis=0).tolist(), "high": merged.vertices.max(axis=0).tolist()},
        "watertight": bool(mesh.is_watertight),
        "handles": int(1 - mesh.euler_number // 2),
        "edge": merged.cell,
    }
    surface = Surface(
        merged.vertices.astype(np.float32),
        merged.triangles.astype(np.int32),
        merged.normals.astype(np.float32),
        merged.confidence.astype(np.float32),
    )
    files = {
        "model.ply": StoredFile(ply_bytes(surface), "model/ply"),
        "model.glb": StoredFile(glb_bytes(surface, METRES_PER_MM if unit == "mm" else 1.0), "model/gltf-binary"),
        "model.json": StoredFile(json.dumps(about, indent=1).encode(), "application/json"),
        "model.png": StoredFile(encode_png(picture_sheet(surface)), "image/png"),
    }
    return Outcome(
        arrays={
            "vertices": surface.vertices,
            "triangles": surface.triangles,
            "confidence": surface.confidence,
            "source": merged.source.astype(np.int16),
        },
        record=about,
        files=files,
        counts={
            "views": len(placed.views),
            "vertices": len(surface.vertices),
            "triangles": len(surface.triangles),
            "seen": round(seen, 4),
        },
        warnings=[_warning(each) for each in placed.left_out],
    )


def _told(view: View, placed: Placed, merged: Model, number: int) -> dict[str, Any]:
    """A view in model.json: its pose and where it is from, its residual, the share of the surface that it says most
    of."""
    known = "given" if placed.turntable is None else "solved"
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = view.rotation.T, -view.rotation.T @ view.translation
    return {
        "capture": view.name,
        "pose": "found" if view.name in placed.found else known,
        "camera_to_world": matrix.tolist(),
        "outline_misses_pixels": round(placed.misses[number], 3),
        "share": round(float((merged.source == number).mean()), 4),
    }


def _turntable(placed: Placed) -> dict[str, Any]:
    table = placed.turntable
    assert table is not None
    return {
        "offset": table.offset,
        "leans_to_camera_degrees": table.towards,
        "leans_to_the_right_degrees": table.sideways,
        "angles": {view.name: round(float(angle), 3) for view, angle in zip(placed.views, table.angles, strict=True)},
    }


def _area_share(mesh: trimesh.Trimesh, vertices: np.ndarray) -> float:
    return float((mesh.area_faces * vertices[mesh.faces].mean(axis=1)).sum() / max(mesh.area, 1e-12))


def _warning(left_out: LeftOut) -> str:
    return f"{left_out.name} is not part of the model: {left_out.reason}; {left_out.remedy}"


def picture_sheet(surface: Surface, size: int = 260) -> np.ndarray:
    """The model from all around, (2 size, 3 size) uint8."""
    pictures = [draw_surface(surface, float(azimuth), 15.0, size) for azimuth in AROUND]
    return np.vstack([np.hstack(pictures[:3]), np.hstack(pictures[3:])])
