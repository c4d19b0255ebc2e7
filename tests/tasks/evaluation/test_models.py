"""True models of objects: files that hold none are refused."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from glint.storage.errors import InputError
from glint.tasks.evaluation.models import load_true_mesh


@pytest.fixture(scope="module")
def ply() -> bytes:
    return bytes(trimesh.creation.icosphere(1).export(file_type="ply"))


def load(folder: Path, name: str, data: bytes) -> trimesh.Trimesh:
    (folder / name).write_bytes(data)
    return load_true_mesh(str(folder / name))


def test_a_true_model_is_read(tmp_path: Path, ply: bytes) -> None:
    assert len(load(tmp_path, "model.ply", ply).faces) == 80
    assert len(load(tmp_path, "MODEL.PLY", ply).faces) == 80


@pytest.mark.parametrize("name", ["model.gltf", "model.glb", "model.zip", "model.3mf", "model.dae", "model"])
def test_other_files_than_meshes_of_one_surface_are_named(tmp_path: Path, ply: bytes, name: str) -> None:
    with pytest.raises(InputError, match=f"{name} is not a PLY") as caught:
        load(tmp_path, name, ply)
    assert "ply" in caught.value.remedy


def test_a_damaged_file_is_named(tmp_path: Path, ply: bytes) -> None:
    """Whatever byte of the header is wrong: the library's readers raise errors of many kinds."""
    for position in range(ply.index(b"end_header")):
        data = ply[:position] + b"\x00" + ply[position + 1 :]
        try:
            load(tmp_path, "model.ply", data)
        except InputError as error:
            assert "model.ply" in error.message
    for data in (b"", ply[:100], ply[: len(ply) // 2]):
        with pytest.raises(InputError, match=r"model\.ply"):
            load(tmp_path, "model.ply", data)


def test_a_model_without_size_is_named(tmp_path: Path) -> None:
    corners, triangle = np.eye(3), np.array([[0, 1, 2]])
    for vertices, faces, message in (
        (corners, np.zeros((0, 3), int), "no triangles"),
        (np.ones((3, 3)), triangle, "no area"),
        (np.where(corners == 1.0, np.nan, corners), triangle, "no triangles"),
    ):
        mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
        with pytest.raises(InputError, match=message):
            load(tmp_path, "model.ply", bytes(mesh.export(file_type="ply")))
