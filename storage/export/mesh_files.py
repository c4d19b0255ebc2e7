"""Triangle meshes as files: the store's PLY files are read, text PLY written, and facts added to binary glTF."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glint.storage.errors import StoreError

_PLY_TYPES = {"float": "<f4", "double": "<f8", "int": "<i4", "uint": "<u4", "uchar": "u1"}
_GLB_HEADER = b"glTF" + (2).to_bytes(4, "little")
PLY_REMEDY = "run the object again"


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh.

    vertices: (N, 3) float32 in `unit`; triangles: (M, 3) int32, counter-clockwise seen from outside; normals: (N, 3)
    float32, unit length; confidence: (N,) float32 in 0..1, NaN where the file has none.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    unit: str = "pixels"

    @property
    def faces(self) -> np.ndarray:
        """The triangles, by the name that other libraries use."""
        return self.triangles

    def __repr__(self) -> str:
        """Return the number of vertices and triangles, and the unit."""
        return f"<Mesh of {len(self.vertices):,} vertices and {len(self.triangles):,} triangles, unit {self.unit}>"


def read_ply(data: bytes, unit: str, name: str = "the mesh") -> Mesh:
    """Return the mesh in a binary PLY file with vertex normals and triangles, as the store keeps it.

    Nothing in the file is trusted: a store may come from anybody.

    Raises:
        StoreError: it is something else; `name` names it in the message.
    """
    header, mark, body = data.partition(b"end_header\n")
    text = header.decode("ascii", "replace")
    sizes = {kind: int(count) for kind, count in re.findall(r"^element (\w+) (\d{1,12})$", text, re.MULTILINE)}
    properties = re.findall(r"^property (\w+) (\w+)$", text, re.MULTILINE)
    if not mark or "format binary_little_endian 1.0" not in text or not {"vertex", "face"} <= sizes.keys():
        raise StoreError(f"{name} is not a binary PLY file of a mesh", PLY_REMEDY)
    if "property list uchar int vertex_ind" not in text or any(kind not in _PLY_TYPES for kind, _ in properties):
        raise StoreError(f"{name} is a PLY file of another arrangement than Glint writes", PLY_REMEDY)
    labels = [label for _, label in properties]
    if len(set(labels)) < len(labels):
        raise StoreError(f"{name} is a PLY file that names a property twice", PLY_REMEDY)
    vertex = np.dtype([(label, _PLY_TYPES[kind]) for kind, label in properties])
    face = np.dtype([("corners", "u1"), ("triangle", "<i4", (3,))])
    split = sizes["vertex"] * vertex.itemsize
    if len(body) != split + sizes["face"] * face.itemsize or not {"x", "y", "z", "nx", "ny", "nz"} <= set(labels):
        raise StoreError(f"{name} is truncated, or lacks normals or triangles", PLY_REMEDY)
    vertices, faces = np.frombuffer(body[:split], vertex), np.frombuffer(body[split:], face)
    corners = faces["triangle"]
    if (faces["corners"] != 3).any() or (corners < 0).any() or (corners >= len(vertices)).any():
        raise StoreError(f"{name} has faces that are no triangles of its {len(vertices):,} vertices", PLY_REMEDY)
    missing = np.full(len(vertices), np.nan, np.float32)
    return Mesh(
        np.stack([vertices[axis] for axis in ("x", "y", "z")], axis=-1).astype(np.float32),
        corners.copy(),
        np.stack([vertices[axis] for axis in ("nx", "ny", "nz")], axis=-1).astype(np.float32),
        vertices["confidence"].astype(np.float32) if "confidence" in labels else missing,
        unit,
    )


def with_asset_facts(data: bytes, facts: Mapping[str, str]) -> bytes:
    """Return a binary glTF file whose asset's `extras` hold these facts too (glTF 2.0, section 4.4: the JSON chunk).

    Raises:
        StoreError: it is something else.
    """
    if len(data) < 20 or data[:8] != _GLB_HEADER or data[16:20] != b"JSON":
        raise StoreError("the mesh is not a binary glTF file", PLY_REMEDY)
    end = 20 + int.from_bytes(data[12:16], "little")
    try:
        tree = json.loads(data[20:end])
        tree["asset"]["extras"] = tree["asset"].get("extras", {}) | facts
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise StoreError("the mesh is a binary glTF file without a description of itself", PLY_REMEDY) from error
    text = json.dumps(tree, separators=(",", ":")).encode()
    # Chunks are padded to multiples of four bytes, the JSON chunk with spaces.
    text += b" " * (-len(text) % 4)
    total = 20 + len(text) + len(data) - end
    lengths = [length.to_bytes(4, "little") for length in (total, len(text))]
    return _GLB_HEADER + lengths[0] + lengths[1] + b"JSON" + text + data[end:]


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a text PLY file with vertex normals.

    Raises:
        OSError: the file cannot be written.
    """
    header = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    header += [f"element face {len(mesh.triangles)}", "property list uchar int vertex_indices", "end_header"]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        np.savetxt(file, np.hstack([mesh.vertices, mesh.normals]), fmt="%.6g")
        np.savetxt(file, np.insert(mesh.triangles, 0, 3, axis=1), fmt="%d")
