"""Collect what the viewer shows of an object's model: its mesh, its views' cameras, and the parts that each saw."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from glint.storage.export.page.capture_data import CaptureData
from glint.storage.export.page.mesh_packing import pack_mesh
from glint.storage.export.page.packing import pack
from glint.storage.export.stored_capture import mesh_of
from glint.storage.versions.stage_results import StageResult

NO_VIEW = 255
"""Code of vertices that no view has seen."""


def model_data(merged: StageResult, max_triangles: int) -> CaptureData:
    """Return facts and parts of a model; what each view saw is left out of a decimated mesh.

    Raises:
        StoreError: the model is damaged.
    """
    mesh, parts = pack_mesh(mesh_of(merged, "model.ply"), max_triangles)
    if "source" in merged.arrays and mesh["shown_triangles"] == mesh["triangles"]:
        source = merged.read("source").astype(int)
        codes = np.where(source < 0, NO_VIEW, np.minimum(source, NO_VIEW - 1))
        parts["vertex_source"] = pack(codes.astype(np.uint8)[None])
    facts = {
        "name": "model",
        "mesh": mesh,
        "views": [_view_facts(view) for view in merged.record.get("views", ())],
        "unseen": merged.record.get("unseen"),
        "parts": {name: part.facts for name, part in parts.items()},
    }
    return CaptureData(facts, parts)


def _view_facts(view: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is shown of a view: the unit vectors towards its camera and up, and the share that it determines."""
    matrix = np.array(view["camera_to_world"], float)
    return {
        "name": view["capture"],
        "toward": [round(float(part), 5) for part in matrix[:3, 2]],
        "up": [round(float(part), 5) for part in matrix[:3, 1]],
        "share": view["share"],
    }
