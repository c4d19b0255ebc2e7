"""Read what exports for robots need of a version: each capture's arrays and camera, and the object's model."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.camera import CaptureCamera, camera_of
from glint.storage.export.mesh_files import Mesh, read_ply
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult

ARRAYS = {
    "mask": ("mask", "mask"),
    "normals": ("labels", "normals"),
    "confidence": ("labels", "confidence"),
    "provenance": ("labels", "provenance"),
    "initial_normals": ("silhouette", "initial"),
    "depth": ("depth", "depth"),
    "depth_provenance": ("depth", "provenance"),
    "lights": ("lights", "lights"),
    "half_vectors": ("lights", "half_vectors"),
    "reason": ("lights", "reason"),
    "observations": ("clusters", "observations"),
    "candidates": ("clusters", "normals"),
    "labels": ("labels", "labels"),
}
"""Stage and array of what readers and exports call by one name."""

MODEL_STAGE = "model"


@dataclass(frozen=True, slots=True, eq=False)
class ExportedCapture:
    """One capture of a version, read whole: arrays of the region as in docs/reading.md."""

    name: str
    camera: CaptureCamera
    mask: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    depth: np.ndarray
    surface: Mesh


def entry_of(version: Version, capture: str) -> Mapping[str, Any]:
    """Return the catalogue's entry from which a capture was computed; empty where the version does not record it."""
    return version.metadata.get("captures", {}).get(capture, {}).get("entry", {})


def ordered_stages(stages: Iterable[str], version: Version) -> list[str]:
    """Return stages in the order in which they ran, which the version records; others after them by name."""
    order = version.metadata.get("stages", [])
    return sorted(stages, key=lambda stage: (order.index(stage) if stage in order else len(order), stage))


def model_result(repository: ObjectRepository, version: Version) -> StageResult | None:
    """Return the result that holds the object's model, None where the version has none."""
    if MODEL_STAGE not in version.stages.get(WHOLE_OBJECT, {}):
        return None
    return repository.load(WHOLE_OBJECT, MODEL_STAGE, version.snapshot)


def mesh_of(result: StageResult, file: str) -> Mesh:
    """Return the mesh that a stage (surface, model) left as a PLY file.

    Raises:
        StoreError: there is none, or it is damaged.
    """
    unit = result.record.get("unit") or "pixels"
    return read_ply(result.read_file(file), unit, f"{result.name}/{file}")


def exported_captures(
    repository: ObjectRepository, version: Version, model: StageResult | None
) -> Iterator[ExportedCapture]:
    """Yield the captures of a version by name, one at a time in memory.

    Raises:
        StoreError: a result is missing or damaged.
    """
    for capture in sorted(version.captures):
        stages = repository.load_capture(capture, version.snapshot)
        absent = sorted({"survey", "mask", "labels", "depth", "surface"} - stages.keys())
        if absent:
            raise StoreError(f"{version.name} has no {', '.join(absent)} of {capture}", "run the object again")
        camera = camera_of(stages, entry_of(version, capture), model.record if model else None)
        assert camera is not None
        arrays = {
            name: stages[ARRAYS[name][0]].read(ARRAYS[name][1]) for name in ("mask", "normals", "confidence", "depth")
        }
        yield ExportedCapture(capture, camera, surface=mesh_of(stages["surface"], "surface.ply"), **arrays)
