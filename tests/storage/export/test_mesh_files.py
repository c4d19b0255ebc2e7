"""Mesh files of a store that comes from others: what they state is checked before it is used."""

import struct

import pytest

from glint.storage.errors import StoreError
from glint.storage.export.mesh_files import read_ply, with_asset_facts


@pytest.mark.parametrize(
    ("names", "corners", "message"),
    [
        (("x", "y", "z", "nx", "ny", "nz", "x"), (3, 0, 1, 2), "names a property twice"),
        (("x", "y", "z", "nx", "ny", "nz"), (4, 0, 1, 2), "no triangles of its 3 vertices"),
        (("x", "y", "z", "nx", "ny", "nz"), (3, 0, 1, 3), "no triangles of its 3 vertices"),
        (("x", "y", "z", "nx", "ny", "nz"), (3, 0, 1, -1), "no triangles of its 3 vertices"),
    ],
)
def test_a_mesh_of_a_strange_store_is_refused(names: tuple[str, ...], corners: tuple[int, ...], message: str) -> None:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "element vertex 3",
        *(f"property float {name}" for name in names),
    ]
    lines += ["element face 1", "property list uchar int vertex_indices", "end_header", ""]
    data = "\n".join(lines).encode() + bytes(4 * 3 * len(names)) + struct.pack("<Biii", *corners)
    with pytest.raises(StoreError, match=f"front/surface.ply .*{message}"):
        read_ply(data, "mm", "front/surface.ply")


@pytest.mark.parametrize("description", [b"{", b"{}", b"[]", b'{"asset": []}', b'{"asset": {"extras": 1}}'])
def test_a_glb_file_of_a_strange_store_is_refused(description: bytes) -> None:
    data = b"glTF" + struct.pack("<III", 2, 20 + len(description), len(description)) + b"JSON" + description
    with pytest.raises(StoreError, match="without a description of itself"):
        with_asset_facts(data, {"object": "vase"})
