import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import open3d
import pytest

from glint.storage.errors import StoreError
from glint.storage.export.camera import CaptureCamera, PixelRegion, camera_facts
from glint.storage.export.export import export
from glint.storage.export.formats import export_as
from glint.storage.export.mesh_files import write_ply
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.glint.sample_store import FRAME, MATRIX, Sphere, entry, save_model, save_sphere


@pytest.fixture
def cup(tmp_path: Path) -> ObjectRepository:
    return ObjectRepository.open(Location.parse(tmp_path / "store"), "cup")


def content(path: Path) -> Any:
    return json.loads(path.read_text())


def test_camera_json_stands_beside_the_arrays(store: Path, tmp_path: Path) -> None:
    export(Location.parse(store), "wine-glass", tmp_path / "out")
    phone, front = (content(tmp_path / "out" / name / "camera.json") for name in ("phone", "front"))
    assert phone["projection"] == "perspective" and phone["matrix"] == MATRIX and phone["orthographic_scale"] is None
    assert phone["region_matrix"][0][2] == 33.0 - 12 and phone["region_matrix"][1][2] == 22.0 - 6
    assert phone["depth"]["zero_distance"] == 200.0 and phone["pose"]["source"] == "catalogue"
    assert phone["frames"]["ros_optical"]["unit"] == "m"
    assert phone["distortion"] == {"model": "none", "coefficients": []}
    assert front["projection"] == "orthographic" and front["matrix"] is None and front["region_matrix"] is None
    assert front["orthographic_scale"] == {"value": 0.5, "unit": "mm per pixel"}
    assert front["frame_size"] == {"width": 64, "height": 48} and front["region"]["width"] == 40
    assert "(0, 0)" in front["pixels"] and front["pose"]["camera_to_world"] is None
    # The file alone leads from depth to OpenCV's camera frame, and back to pixels.
    depth = np.load(tmp_path / "out/phone/depth.npy")
    rows, columns = np.nonzero(np.isfinite(depth))
    ahead = phone["depth"]["zero_distance"] - depth[rows, columns]
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(phone["region_matrix"]).T
    mesh = open3d.io.read_triangle_mesh(tmp_path / "out/phone/surface.ply")
    points = np.asarray(mesh.vertices)
    conversion = np.array(phone["frames"]["opencv"]["from_camera"])
    np.testing.assert_allclose((rays * ahead[:, None])[: len(points)], points @ conversion[:3, :3].T, atol=1e-3)


def test_the_world_has_the_unit_of_the_objects_model() -> None:
    region = PixelRegion(0, 0, 4, 3)
    alone = CaptureCamera(np.eye(3), region, (4, 3), None, "pixels", 1.0)
    units = [camera_facts(camera)["frames"]["world"]["unit"] for camera in (alone, replace(alone, world_unit="mm"))]
    assert units == ["pixels", "mm"]


def test_a_camera_of_unknown_scale_has_no_metres(cup: ObjectRepository, tmp_path: Path) -> None:
    save_sphere(cup, scale_known=False)
    cup.publish(["front"], {})
    export(cup.location, "cup", tmp_path / "out")
    camera = content(tmp_path / "out/front/camera.json")
    assert camera["unit"] == "pixels" and camera["frames"]["ros_optical"]["from_camera"] is None
    export_as("pcd", cup.location, "cup", tmp_path / "pcd")
    assert b"# unit pixels;" in (tmp_path / "pcd/front/cloud.pcd").read_bytes()


def test_a_point_cloud_is_read_by_open3d(store: Path, tmp_path: Path) -> None:
    record = export_as("pcd", Location.parse(store), "wine-glass", tmp_path / "out")
    assert record.captures == ("front", "phone") and record.files == 5
    for name, centre, unknown in (("front", (0, 0, 0), b"offset"), ("phone", (0, 0, 0.2), b"scale")):
        path = tmp_path / "out" / name / "cloud.pcd"
        (note,) = [line for line in path.read_bytes().splitlines()[:4] if line.startswith(b"# a single view leaves")]
        assert unknown in note and note.isascii()
        cloud = open3d.io.read_point_cloud(path)
        offsets = np.asarray(cloud.points) - centre
        np.testing.assert_allclose(np.linalg.norm(offsets, axis=-1), 0.006, atol=1e-6)
        np.testing.assert_allclose(np.asarray(cloud.normals), offsets / 0.006, atol=1e-3)
        fields = open3d.t.io.read_point_cloud(path).point
        np.testing.assert_allclose(np.unique(fields["confidence"].numpy()), [0.4, 0.97], atol=1e-6)
        assert content(path.with_name("camera.json"))["unit"] == "mm"


def projected(folder: Path, image: str, object_number: int) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Pixels (N, 2) and distances (N,) of a model's vertices in an image, by the files of the dataset alone."""
    scene = folder / "train" / f"{object_number:06d}"
    camera, (pose,) = content(scene / "scene_camera.json")[image], content(scene / "scene_gt.json")[image]
    mesh = open3d.io.read_triangle_mesh(folder / "models" / f"obj_{object_number:06d}.ply")
    rotation, shift = np.reshape(pose["cam_R_m2c"], (3, 3)), np.array(pose["cam_t_m2c"])
    assert np.linalg.det(rotation) == pytest.approx(1.0) and mesh.has_vertex_normals()
    matrix, vertices = np.reshape(camera["cam_K"], (3, 3)), np.asarray(mesh.vertices)
    pixels, _ = cv2.projectPoints(vertices, cv2.Rodrigues(rotation)[0], shift, matrix, None)
    return pixels[:, 0], (vertices @ rotation.T + shift)[:, 2], camera


def picture(path: Path) -> np.ndarray:
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert values is not None and values.shape == FRAME[::-1]
    return values


@pytest.mark.long
def test_a_bop_dataset_of_single_captures(cup: ObjectRepository, tmp_path: Path) -> None:
    for name in ("left", "right"):
        save_sphere(cup, name, Sphere((0.5, 0.0, -200.0), 6.0), MATRIX)
    cup.publish(["left", "right"], {"captures": {name: entry(MATRIX) for name in ("left", "right")}})
    export_as("bop", cup.location, "cup", tmp_path / "out")
    folder = tmp_path / "out"
    for number, image in ((1, "0"), (2, "1")):
        scene, stem = folder / "train" / f"{number:06d}", f"{int(image):06d}"
        pixels, distances, camera = projected(folder, image, number)
        depth = picture(scene / "depth" / f"{stem}.png")
        mask = picture(scene / "mask" / f"{stem}_000000.png")
        assert depth.dtype == np.uint16 and camera["depth_scale"] == 0.01 and "cam_R_w2c" not in camera
        columns, rows = np.rint(pixels).astype(int).T
        np.testing.assert_allclose(pixels, np.rint(pixels), atol=2e-3)
        known = depth[rows, columns] > 0
        assert known.mean() > 0.9
        np.testing.assert_allclose(depth[rows, columns][known] * camera["depth_scale"], distances[known], atol=0.01)
        assert set(np.unique(mask)) == {0, 255} and (mask[depth > 0] > 0).all()
        np.testing.assert_array_equal(picture(scene / "mask_visib" / f"{stem}_000000.png"), mask)
        (info,) = content(scene / "scene_gt_info.json")[image]
        assert (info["px_count_all"], info["px_count_valid"]) == ((mask > 0).sum(), (depth > 0).sum())
        x, y, width, height = info["bbox_obj"]
        assert (mask[y : y + height, x : x + width] > 0).sum() == info["px_count_all"]
    models = content(folder / "models/models_info.json")
    assert set(models) == {"1", "2"}
    assert {"diameter", "min_x", "min_y", "min_z", "size_x", "size_y", "size_z"} == set(models["1"])
    assert models["1"]["min_x"] == pytest.approx(-models["1"]["size_x"] / 2, abs=1e-4)
    assert content(folder / "camera.json")["fx"] == 500.0
    assert (folder / "dataset_info.md").read_text().startswith("# cup, v1")


@pytest.mark.long
def test_a_bop_dataset_of_a_merged_model(cup: ObjectRepository, tmp_path: Path) -> None:
    """Two cameras on opposite sides of a sphere whose centre is (1, 2, 3) mm in the world frame."""
    shapes = {"near": Sphere((1.0, 2.0, -197.0), 6.0), "far": Sphere((-1.0, 2.0, -203.0), 6.0)}
    poses = {"near": np.eye(4), "far": np.diag([-1.0, 1.0, -1.0, 1.0])}
    poses["near"][2, 3], poses["far"][2, 3] = 200.0, -200.0
    for name in (*shapes, "lost"):
        save_sphere(cup, name, shapes.get(name), MATRIX, depth_factor=1.03 if name == "far" else 1.0)
    views = [{"capture": name, "camera_to_world": pose.tolist()} for name, pose in poses.items()]
    save_model(cup, Sphere((1.0, 2.0, 3.0), 6.0), views)
    captures = {name: entry(MATRIX, pose={"turntable": 0.0}) for name in (*shapes, "lost")}
    cup.publish([*captures, "_object"], {"captures": captures})
    export_as("bop", cup.location, "cup", tmp_path / "out")
    scene = tmp_path / "out/train/000001"
    assert sorted(content(scene / "scene_gt.json")) == ["0", "1"], "a capture that the model leaves out has no pose"
    assert content(tmp_path / "out/models/models_info.json")["1"]["diameter"] == pytest.approx(12.0, abs=1e-3)
    for image in ("0", "1"):
        pixels, distances, camera = projected(tmp_path / "out", image, 1)
        depth = picture(scene / "depth" / f"{int(image):06d}.png") * camera["depth_scale"]
        columns, rows = np.rint(pixels).astype(int).T
        facing = distances < distances.min() + 2.0
        assert facing.sum() > 10
        np.testing.assert_allclose(depth[rows, columns][facing], distances[facing], atol=0.3)
        world = np.reshape(camera["cam_R_w2c"], (3, 3)) @ [1.0, 2.0, 3.0] + camera["cam_t_w2c"]
        np.testing.assert_allclose(world, content(scene / "scene_gt.json")[image][0]["cam_t_m2c"], atol=1e-4)


@pytest.mark.long
def test_what_bop_cannot_hold_is_refused(store: Path, cup: ObjectRepository, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"needs a perspective camera, that of front is orthographic: .*--format pcd"):
        export_as("bop", Location.parse(store), "wine-glass", tmp_path / "out")
    save_sphere(cup, matrix=MATRIX, scale_known=False)
    cup.publish(["front"], {"captures": {"front": entry(MATRIX)}})
    with pytest.raises(StoreError, match=r"counts in millimetres, the scale of front is unknown: .*pixel_size"):
        export_as("bop", cup.location, "cup", tmp_path / "out")
    with pytest.raises(StoreError, match="no export format 'obj': use one of files, bop, pcd"):
        export_as("obj", cup.location, "cup", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["store"], "nothing is left"


def test_only_an_earlier_export_is_replaced(store: Path, tmp_path: Path) -> None:
    out, location = tmp_path / "out", Location.parse(store)
    export_as("pcd", location, "wine-glass", out, "v1")
    assert export_as("pcd", location, "wine-glass", out).captures == ("front", "phone")
    (out / "export.json").write_text(json.dumps({"object": "vase", "format": "pcd"}))
    with pytest.raises(StoreError, match="not an export of wine-glass as pcd: name another folder"):
        export_as("pcd", location, "wine-glass", out)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="not an export of wine-glass"):
        export_as("pcd", location, "wine-glass", tmp_path / "mine")
    assert [path.name for path in tmp_path.rglob("notes.txt")] == ["notes.txt"]


def test_a_text_mesh_is_read_by_open3d(store: Path, tmp_path: Path) -> None:
    import glint

    mesh = glint.open(store)["wine-glass"].latest["front"].mesh
    write_ply(tmp_path / "mesh.ply", mesh)
    back = open3d.io.read_triangle_mesh(tmp_path / "mesh.ply")
    np.testing.assert_allclose(np.asarray(back.vertices), mesh.vertices, atol=1e-4)
    np.testing.assert_array_equal(np.asarray(back.triangles), mesh.triangles)
