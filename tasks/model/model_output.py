"""Output of the model stage: the mesh as arrays and files, and the report model.json."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import trimesh

from glint.storage.export.image_files import encode_png
from glint.storage.versions.stage_results import StoredFile
from glint.tasks.algorithms.meshing.depth_mesh import Surface
from glint.tasks.algorithms.meshing.mesh_encoding import glb_bytes, ply_bytes
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.view_rejection import RejectedView
from glint.tasks.engine.stage import StageOutput
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.figures.model_sheet import model_sheet
from glint.tasks.model.base_plane import BasePlane
from glint.tasks.model.corrections import correction_warnings
from glint.tasks.model.pose_doubts import PoseDoubts

OBSERVED_CONFIDENCE = 0.5
"""Confidence from which a part of the surface counts as observed."""


def model_output(
    registered: RegisteredViews,
    model: Model,
    unit: str,
    sphere_doubts: Mapping[str, Sequence[StageWarning]],
    base: BasePlane,
    pose_doubts: PoseDoubts,
) -> StageOutput:
    """Return a model's arrays, files, report, counts and warnings.

    unit: "mm" or "pixels"; sphere_doubts: warnings about the spheres of views, by their names; base: the plane on which
    the object stands; pose_doubts: what the views' normals say of their poses.
    """
    report = {**model_report(registered, model, unit, pose_doubts), "base_plane": base.record}
    surface = Surface(
        model.vertices.astype(np.float32),
        model.triangles.astype(np.int32),
        model.normals.astype(np.float32),
        model.confidence.astype(np.float32),
    )
    files = {
        "model.ply": (ply_bytes(surface), "model/ply"),
        "model.glb": (glb_bytes(surface, unit), "model/gltf-binary"),
        "model.json": (json.dumps(report, indent=1).encode(), "application/json"),
        "model.png": (encode_png(model_sheet(surface)), "image/png"),
    }
    return StageOutput(
        arrays={
            "vertices": surface.vertices,
            "triangles": surface.triangles,
            "confidence": surface.confidence,
            "source": model.source.astype(np.int16),
        },
        record=report,
        files={name: StoredFile(data, media_type) for name, (data, media_type) in files.items()},
        counts={
            "views": len(registered.views),
            "vertices": len(surface.vertices),
            "triangles": len(surface.triangles),
            "seen": round(report["seen"], 4),
        },
        warnings=[
            *map(_rejection_warning, registered.rejected),
            *correction_warnings(registered),
            *pose_doubts.warnings,
            *_sphere_warnings(sphere_doubts),
            *base.warnings,
        ],
    )


def model_report(registered: RegisteredViews, model: Model, unit: str, pose_doubts: PoseDoubts) -> dict[str, Any]:
    """Return the content of model.json: views and their poses, rejected views, turntable, figures of the mesh.

    `seen`, `unseen`: shares of the surface's area with confidence >= OBSERVED_CONFIDENCE, and that no view shows;
    `volume`, `area`, `bounding_box`, `edge` in units of the model; `handles`: the genus.
    """
    mesh = trimesh.Trimesh(model.vertices, model.triangles, process=False)
    shares = pose_doubts.agreement.shares(range(len(registered.views)))
    return {
        "unit": unit,
        "views": [_view_report(number, registered, model, shares[number]) for number in range(len(registered.views))],
        "left_out": [asdict(view) for view in registered.rejected],
        "turntable": _turntable_report(registered),
        "seen": _area_share(mesh, model.confidence >= OBSERVED_CONFIDENCE),
        "unseen": _area_share(mesh, model.source < 0),
        "volume": float(mesh.volume),
        "area": float(mesh.area),
        "bounding_box": {"low": model.vertices.min(axis=0).tolist(), "high": model.vertices.max(axis=0).tolist()},
        "watertight": bool(mesh.is_watertight),
        "handles": int(1 - mesh.euler_number // 2),
        "edge": model.cell,
    }


def _view_report(number: int, registered: RegisteredViews, model: Model, agreeing: float) -> dict[str, Any]:
    """Return a view's entry: its pose and where that comes from, its scale, its residual, the share of its vertices.

    agreeing: the share of its confident normals with which other views agree, NaN if none shows the same part.
    """
    view = registered.views[number]
    on_table = 0 if registered.turntable is None else len(registered.turntable.angles)
    origin = "solved" if number < on_table else "given"
    return {
        "capture": view.name,
        "pose": "found" if view.name in registered.searched else origin,
        "camera_to_world": view.camera_to_world.tolist(),
        "scale_factor": round(registered.scale_factors.get(view.name, 1.0), 5),
        "outline_misses_pixels": round(registered.residuals[number], 3),
        "normals_agree": None if np.isnan(agreeing) else round(float(agreeing), 3),
        "share": round(float((model.source == number).mean()), 4),
    }


def _turntable_report(registered: RegisteredViews) -> Mapping[str, Any] | None:
    """Return the turntable's entry, None if the poses are not a turntable's."""
    table = registered.turntable
    if table is None:
        return None
    angles = zip(registered.views, table.angles, strict=False)
    return {
        "offset": table.offset,
        "leans_to_camera_degrees": table.lean_to_camera,
        "leans_to_the_right_degrees": table.lean_right,
        "angles": {view.name: round(float(angle), 3) for view, angle in angles},
    }


def _area_share(mesh: trimesh.Trimesh, is_counted: np.ndarray) -> float:
    """Return the share of the mesh's area that the counted vertices (N,) bool hold."""
    return float((mesh.area_faces * is_counted[mesh.faces].mean(axis=1)).sum() / max(mesh.area, 1e-12))


def _rejection_warning(rejected: RejectedView) -> StageWarning:
    return StageWarning(f"{rejected.name} is not part of the model: {rejected.reason}; {rejected.remedy}", "views")


def _sphere_warnings(sphere_doubts: Mapping[str, Sequence[StageWarning]]) -> list[StageWarning]:
    return [
        replace(doubt, message=f"{name} counts less in the model: {doubt.message}")
        for name, view_doubts in sphere_doubts.items()
        for doubt in view_doubts
    ]
