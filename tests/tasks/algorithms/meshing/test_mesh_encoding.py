import io
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from glint.tasks.algorithms.meshing.depth_mesh import mesh_from_depth
from glint.tasks.algorithms.meshing.mesh_encoding import glb_bytes, ply_bytes
from tests.tasks.algorithms.meshing.inclined_plane import plane


def test_files_open_again_with_normals_to_the_camera_and_their_confidence() -> None:
    depth, mask, normals = plane()
    confidence = np.linspace(0, 1, mask.size, dtype=np.float32).reshape(mask.shape)
    mesh = mesh_from_depth(depth, mask, normals, confidence=confidence)

    ply = trimesh.load_mesh(io.BytesIO(ply_bytes(mesh)), file_type="ply", process=False)
    assert np.allclose(ply.vertices, mesh.vertices) and np.array_equal(ply.faces, mesh.triangles)
    assert np.allclose(ply.vertex_normals, mesh.normals, atol=1e-6) and (ply.face_normals[:, 2] > 0).all()
    assert np.allclose(ply.metadata["_ply_raw"]["vertex"]["data"]["confidence"].ravel(), mesh.confidence)

    glb = trimesh.load_mesh(io.BytesIO(glb_bytes(mesh, "mm")), file_type="glb", process=False)
    assert np.allclose(glb.vertices, 0.001 * mesh.vertices, atol=1e-6) and np.array_equal(glb.faces, mesh.triangles)
    assert np.allclose(glb.vertex_normals, mesh.normals, atol=1e-5)
    assert np.allclose(glb.vertex_attributes["_confidence"].ravel(), mesh.confidence)


@pytest.mark.parametrize(("unit", "written", "scale"), [("mm", "m", "known"), ("pixels", "pixels", "unknown")])
def test_a_glb_has_two_sides_and_says_its_unit(unit: str, written: str, scale: str) -> None:
    data = glb_bytes(mesh_from_depth(*plane()), unit)
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert tree["asset"]["extras"] == {"unit": written, "scale": scale}
    assert [material["doubleSided"] for material in tree["materials"]] == [True]
    assert {view["target"] for view in tree["bufferViews"]} == {34962, 34963}


def test_open3d_reads_the_ply(tmp_path: Path) -> None:
    open3d = pytest.importorskip("open3d")
    mesh = mesh_from_depth(*plane())
    (tmp_path / "surface.ply").write_bytes(ply_bytes(mesh))
    read = open3d.io.read_triangle_mesh(str(tmp_path / "surface.ply"))
    assert np.asarray(read.triangles).shape == mesh.triangles.shape
    assert (np.asarray(read.vertex_normals)[:, 2] > 0).all()
