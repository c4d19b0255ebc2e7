"""Stores and results of a capture, shared by tests."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import icechunk
import numpy as np
from obstore.store import MemoryStore, ObjectStore

from glint.storage.locations.location import Location
from glint.storage.versions.array_schema import ArraySchema
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import StoredFile

REASONS = ("accepted", "no light", "two lights")
PROVENANCE = ("outside", "observed", "marked", "silhouette", "filled")
SCHEMAS = {
    "clusters": {"observations": ArraySchema("HW", "i")},
    "lights": {
        "half_vectors": ArraySchema("T3", "f", "accepted"),
        "lights": ArraySchema("T3", "f", "accepted"),
        "reason": ArraySchema("T", "u"),
    },
    "mask": {"mask": ArraySchema("HW", "b")},
    "labels": {"normals": ArraySchema("HW3", "f", "mask"), "confidence": ArraySchema("HW", "f", "mask")},
    "depth": {"depth": ArraySchema("HW", "f", "mask")},
}
STAGES = tuple(SCHEMAS)


def local_store(folder: Path) -> Location:
    """A local store."""
    return Location.parse(folder)


@dataclass(frozen=True, slots=True)
class MemoryLocation(Location):
    """A store in this process that honours conditions and has no locks, as an object store does.

    store: of the root; repositories: by path, shared with all locations below.
    """

    scheme: str = "memory"
    container: str = field(default_factory=lambda: uuid4().hex)
    path: str = ""
    store: MemoryStore = field(default_factory=MemoryStore, compare=False)
    repositories: dict[str, icechunk.Storage] = field(default_factory=dict, compare=False)

    def child(self, *parts: str) -> "MemoryLocation":
        return replace(self, path="/".join((self.path, *parts)).lstrip("/"))

    def obstore(self) -> ObjectStore:
        return MemoryStore() if self.path else self.store

    def icechunk_storage(self) -> icechunk.Storage:
        return self.repositories.setdefault(self.path, icechunk.in_memory_storage())


def capture_arrays(seed: int = 0, height: int = 12, width: int = 16, frames: int = 20) -> dict[str, dict[str, Any]]:
    """Arrays by stage of a small capture: known, different by seed, NaN where they must be."""
    random = np.random.default_rng(seed)
    mask = np.zeros((height, width), bool)
    mask[2:-2, 3:-3] = True
    normals = random.normal(size=(height, width, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[~mask] = np.nan
    reason = np.zeros(frames, np.uint8)
    reason[3], reason[7] = 1, 2
    lights = random.normal(size=(frames, 3)).astype(np.float32)
    lights /= np.linalg.norm(lights, axis=-1, keepdims=True)
    lights[reason > 0] = np.nan
    layers = (3, height, width)
    observations = random.integers(0, 4, (height, width)).astype(np.int32)
    confidence = np.where(mask, random.random((height, width)), np.nan).astype(np.float32)
    return {
        "lights": {"half_vectors": lights * 0.5, "lights": lights, "reason": reason},
        "mask": {"mask": mask},
        "clusters": {
            "normals": np.stack([normals] * 3),
            "weight": random.random(layers).astype(np.float32),
            "spread": random.random(layers).astype(np.float32),
            "count": np.ones(layers, np.int32),
            "observations": observations,
            "winner": normals,
        },
        "silhouette": {"rim": mask, "initial": normals},
        "labels": {
            "labels": np.ones(layers, np.uint8),
            "normals": normals,
            "provenance": np.where(mask, np.where(observations > 0, 1, 4), 0).astype(np.uint8),
            "confidence": confidence,
        },
        "depth": {
            "depth": np.where(mask, random.normal(size=mask.shape), np.nan).astype(np.float32),
            "provenance": mask.astype(np.uint8),
        },
        "surface": {},
    }


def small_ply(seed: int = 0) -> bytes:
    """A mesh of one triangle as the stages write it, another one for each seed."""
    vertex = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "confidence")]
    vertices = np.array([(0, 0, seed, 0, 0, 1, 0.9), (4, 0, seed, 0, 0, 1, 0.5), (0, 3, seed, 0, 0, 1, 1)], vertex)
    face = np.array([(3, (0, 1, 2))], [("corners", "u1"), ("triangle", "<i4", (3,))])
    header = ["ply", "format binary_little_endian 1.0", "element vertex 3"]
    header += [f"property float {name}" for name, _ in vertex]
    header += ["element face 1", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(header).encode() + vertices.tobytes() + face.tobytes()


RECORDS: dict[str, dict[str, Any]] = {
    "lights": {
        "reasons": REASONS,
        "seconds": 1.5,
        "warnings": [{"message": "few <b>lights</b>; sweep & film again", "cause": "light", "cost_deg": 1.5}],
    },
    "mask": {"region": {"x": 5, "y": 6, "width": 16, "height": 12}},
    "labels": {"provenance": PROVENANCE, "parameters": {"method": "paper"}},
    "depth": {"unit": "mm", "pixel_size": 0.21},
}


def save_capture(repository: ObjectRepository, capture: str, key: str, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Save all stages of a capture under `key`, its surface with two files; the arrays."""
    arrays = capture_arrays(seed)
    for stage, values in arrays.items():
        files = {}
        if stage == "surface":
            files["surface.ply"] = StoredFile(small_ply(seed), "model/ply")
            files["relit_left.png"] = StoredFile(PIXEL, "image/png")
        repository.save(capture, stage, key, values, RECORDS.get(stage, {}), files)
    return arrays


PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010800000000"
    "3a7e9b550000000a49444154789c636000000002000148afa4710000000049454e44ae426082"
)
"""The smallest PNG."""
