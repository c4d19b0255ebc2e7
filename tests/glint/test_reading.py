from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import glint
from glint.storage.errors import StoreError
from glint.storage.export.point_cloud import has_surface
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.glint.sample_store import MATRIX, Sphere, entry, save_model, save_sphere, sphere_points
from tests.storage.stores import capture_arrays


def test_four_lines_lead_from_an_address_to_arrays(store: Path) -> None:
    normals = glint.open(str(store))["wine-glass"].latest["front"].normals
    assert normals.shape == (36, 40, 3) and normals.dtype == np.float32
    points = sphere_points(Sphere((0, 0, 0), 6.0), None)
    np.testing.assert_allclose(normals, points / 6.0, atol=1e-6)


def test_objects_versions_and_captures_are_mappings(store: Path) -> None:
    opened = glint.open(store)
    assert list(opened) == ["wine-glass"] and len(opened) == 1 and "wine-glass" in opened
    thing = opened["wine-glass"]
    assert opened["wine-glass"] is thing
    assert thing.versions == ("v1", "v2") and list(thing) == ["v1", "v2"] and len(thing) == 2
    assert thing.latest is thing["v2"] is thing.version("v2")
    assert list(thing["v1"]) == ["front"] and list(thing["v2"]) == ["front", "phone"] and len(thing["v2"]) == 2
    version = thing["v2"]
    assert (version.name, version.object_id, version.metadata["run"]) == ("v2", "wine-glass", "r2")
    assert version.time.tzinfo is not None and version.model is None and version.model_record is None
    assert dict(version)["phone"] is version["phone"]


def test_a_wrong_name_is_answered_with_the_nearest(store: Path, tmp_path: Path) -> None:
    opened = glint.open(store)
    with pytest.raises(glint.NotFoundError, match=r"no object 'wine-glas' in .*: did you mean 'wine-glass'\?"):
        opened["wine-glas"]
    with pytest.raises(KeyError, match=r"^no version 'v9' in wine-glass: .*it has 2 versions: v1, v2"):
        opened["wine-glass"]["v9"]
    with pytest.raises(StoreError, match="no capture 'fronts' in wine-glass v2: did you mean 'front'"):
        opened["wine-glass"].latest["fronts"]
    with pytest.raises(glint.NotFoundError, match=r"there is no store .*nowhere"):
        glint.open(tmp_path / "nowhere")
    assert not (tmp_path / "nowhere").exists()
    assert opened.get("../escape") is None and "a/b" not in opened
    assert glint.__version__ == version("glint")
    with pytest.raises(AttributeError, match="no attribute 'opne'"):
        glint.opne  # noqa: B018


def test_a_folder_that_holds_no_store_is_none(tmp_path: Path) -> None:
    assert list(glint.open(tmp_path)) == []
    (tmp_path / "catalogue.yaml").write_text("schema: 1")
    with pytest.raises(glint.NotFoundError, match="holds other files and no store"):
        glint.open(tmp_path)


def test_an_empty_cloud_names_the_highest_confidence(store: Path) -> None:
    capture = glint.open(store)["wine-glass"].latest["front"]
    capture.__dict__["confidence"] = np.full_like(capture.confidence, 0.9)
    with pytest.warns(UserWarning, match=r"no pixel of wine-glass/front has a confidence of 0.95; the highest is 0.90"):
        assert len(capture.point_cloud()) == 0
    capture.__dict__["confidence"] = np.full_like(capture.confidence, 0.94991)
    with pytest.warns(UserWarning, match=r"has a confidence of 0.95; the highest is 0.9499: "):
        assert len(capture.point_cloud()) == 0
    with pytest.raises(ValueError, match="min_confidence is 95"):
        capture.point_cloud(95)


def test_an_object_that_is_still_computed_has_no_version(tmp_path: Path) -> None:
    save_sphere(ObjectRepository.open(Location.parse(tmp_path), "cup"))
    with pytest.raises(glint.NotFoundError, match="cup has no version yet"):
        _ = glint.open(tmp_path)["cup"].latest


@pytest.mark.long
def test_a_new_version_is_seen_by_an_object_that_is_open(tmp_path: Path) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path), "cup")
    save_sphere(repository)
    repository.publish(["front"], {})
    cup = glint.open(tmp_path)["cup"]
    first = cup.latest
    save_sphere(repository, "back")
    repository.publish(["front", "back"], {})
    assert cup.versions == ("v1", "v2") and cup.latest.name == "v2" and list(first) == ["front"]


def test_arrays_are_those_stored(store: Path, tmp_path: Path) -> None:
    saved = save_sphere(ObjectRepository.open(Location.parse(tmp_path), "cup"))
    capture = glint.open(store)["wine-glass"]["v1"]["front"]
    for name in ("normals", "depth", "confidence", "mask", "lights", "half_vectors"):
        np.testing.assert_array_equal(getattr(capture, name), saved[name])
    np.testing.assert_array_equal(capture.accepted, saved["reason"] == 0)
    np.testing.assert_array_equal(capture.provenance, saved["mask"])
    np.testing.assert_array_equal(capture.depth_provenance, saved["mask"])
    assert capture.depth_provenance_names[1] == "integrated"
    np.testing.assert_array_equal(capture.initial_normals, saved["normals"])
    np.testing.assert_array_equal(capture.candidates, capture_arrays(height=36, width=40)["clusters"]["normals"])
    assert [layer.all() for layer in capture.accepted_candidates] == [True, False, False]
    assert capture.provenance_names[1] == "observed" and (capture.observed <= capture.mask).all()
    assert (capture.region.x, capture.region.width, capture.region.rows) == (12, 40, slice(6, 42))
    assert (capture.unit, capture.pixel_size, capture.camera_matrix, capture.pose) == ("mm", 0.5, None, None)


def test_what_was_read_is_kept_and_cannot_be_changed(store: Path) -> None:
    capture = glint.open(store)["wine-glass"]["v2"]["phone"]
    for name in ("normals", "depth", "mask", "observed", "accepted", "camera_matrix", "pose"):
        assert getattr(capture, name) is getattr(capture, name)
        with pytest.raises(ValueError, match="read-only"):
            getattr(capture, name)[...] = 0
    with pytest.raises(ValueError, match="read-only"):
        capture.mesh.vertices[0] = 0
    with pytest.raises(AttributeError):
        capture.id = "other"  # type: ignore[misc]


def test_the_camera_is_read_from_the_survey_or_the_catalogue(store: Path, tmp_path: Path) -> None:
    phone = glint.open(store)["wine-glass"].latest["phone"]
    np.testing.assert_array_equal(phone.camera_matrix, MATRIX)
    assert phone.pose is not None and phone.camera.pose_source == "catalogue"
    repository = ObjectRepository.open(Location.parse(tmp_path), "cup")
    save_sphere(repository, matrix=MATRIX, camera_recorded=True)
    repository.publish(["front"], {"captures": {"front": entry([[1, 0, 0], [0, 1, 0], [0, 0, 1]])}})
    np.testing.assert_array_equal(glint.open(tmp_path)["cup"].latest["front"].camera_matrix, MATRIX)


@pytest.mark.parametrize(("name", "centre"), [("front", (0, 0, 0)), ("phone", (0, 0, -200.0))])
def test_mesh_and_point_cloud_lie_on_the_surface(store: Path, name: str, centre: tuple[float, ...]) -> None:
    capture = glint.open(store)["wine-glass"].latest[name]
    mesh, cloud = capture.mesh, capture.point_cloud(min_confidence=0.0)
    assert mesh.faces is mesh.triangles and mesh.triangles.max() < len(mesh.vertices) and mesh.unit == "mm"
    assert 0.9 * capture.mask.sum() < len(cloud) <= capture.mask.sum()
    assert (cloud.unit, cloud.frame) == ("mm", "camera")
    for points, normals in ((mesh.vertices, mesh.normals), (cloud.points, cloud.normals)):
        offsets = points - np.array(centre)
        np.testing.assert_allclose(np.linalg.norm(offsets, axis=-1), 6.0, atol=1e-3)
        np.testing.assert_allclose(normals, offsets / 6.0, atol=1e-3)
    confident = capture.point_cloud()
    assert 0 < len(confident) < len(cloud) and (confident.confidence >= 0.95).all()
    np.testing.assert_array_equal(np.isfinite(mesh.confidence), True)


def test_a_point_cloud_projects_to_its_pixels(store: Path) -> None:
    import cv2

    phone = glint.open(store)["wine-glass"].latest["phone"]
    assert phone.camera_matrix is not None and phone.pose is not None
    cloud = phone.point_cloud(0.0).in_frame("opencv")
    pixels, _ = cv2.projectPoints(cloud.points.astype(float), np.zeros(3), np.zeros(3), phone.camera_matrix, None)
    rows, columns = np.nonzero(has_surface(phone.camera, phone.depth, phone.normals))
    expected = np.stack([columns + phone.region.x, rows + phone.region.y], axis=-1)
    np.testing.assert_allclose(pixels[:, 0], expected, atol=1e-3)
    # The same through the world frame and the extrinsic matrix.
    world = phone.point_cloud(0.0).points @ phone.pose[:3, :3].T + phone.pose[:3, 3]
    extrinsic = glint.frames.opencv_pose(phone.pose)
    rotation = cv2.Rodrigues(extrinsic[:3, :3])[0]
    pixels, _ = cv2.projectPoints(world, rotation, extrinsic[:3, 3], phone.camera_matrix, None)
    np.testing.assert_allclose(pixels[:, 0], expected, atol=1e-3)


def test_pixels_of_the_silhouette_are_left_out(store: Path) -> None:
    """The pipeline's rim normals lie in the image plane, and their depth far behind."""
    for name in ("front", "phone"):
        capture = glint.open(store)["wine-glass"].latest[name]
        normals = capture.normals.copy()
        row, column = 18, 20
        ray = capture.camera.points(capture.depth)[row, column] if name == "phone" else np.array([0, 0, -1.0])
        across = np.cross(ray, [0.0, 1.0, 0.0])
        normals[row, column] = across / np.linalg.norm(across)
        known = has_surface(capture.camera, capture.depth, capture.normals)
        assert known[row, column]
        known[row, column] = False
        np.testing.assert_array_equal(has_surface(capture.camera, capture.depth, normals), known)


def test_points_take_the_depth_of_the_whole_region(store: Path) -> None:
    capture = glint.open(store)["wine-glass"].latest["front"]
    with pytest.raises(ValueError, match=r"depth is \(5, \d+\), the region \(\d+, \d+\): give all of it"):
        capture.camera.points(capture.depth[:5])


def test_frames_of_reference(store: Path) -> None:
    cloud = glint.open(store)["wine-glass"].latest["front"].point_cloud()
    np.testing.assert_array_equal(cloud.in_frame("opencv").points, cloud.points * [1, -1, -1])
    optical = cloud.in_frame("ros_optical")
    assert optical.unit == "m" and cloud.in_frame("camera") is cloud
    np.testing.assert_allclose(optical.points, cloud.points * [0.001, -0.001, -0.001], rtol=1e-6)
    np.testing.assert_array_equal(optical.normals, cloud.normals * [1, -1, -1])
    np.testing.assert_allclose(glint.frames.to_ros_optical(cloud.points, cloud.unit), optical.points, rtol=1e-6)
    np.testing.assert_array_equal(glint.frames.to_opencv(cloud.normals), optical.normals)
    assert (optical.normals[:, 2] < 0).all(), "visible surfaces face the camera"
    with pytest.raises(ValueError, match="already"):
        optical.in_frame("opencv")
    with pytest.raises(ValueError, match="no size in metres"):
        glint.frames.to_ros_optical(cloud.points, "pixels")
    with pytest.raises(ValueError, match="no frame of reference"):
        cloud.in_frame("opengl")  # type: ignore[arg-type]


def test_a_model_and_the_poses_that_it_found(tmp_path: Path) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path), "cup")
    save_sphere(repository)
    pose = np.diag([-1.0, 1.0, -1.0, 1.0])
    save_model(repository, Sphere((1, 2, 3), 6.0), [{"capture": "front", "camera_to_world": pose.tolist()}])
    repository.publish(["front", "_object"], {"captures": {"front": entry(pose={"turntable": 180.0})}})
    version = glint.open(tmp_path)["cup"].latest
    assert list(version) == ["front"] and version.model is not None and version.model_record is not None
    np.testing.assert_allclose(np.linalg.norm(version.model.vertices - [1, 2, 3], axis=-1), 6.0, atol=1e-4)
    camera = version["front"].camera
    assert (camera.pose_source, camera.turntable_degrees) == ("model", 180.0)
    np.testing.assert_array_equal(version["front"].pose, pose)
    assert "with a model" in repr(version)


def test_the_report_is_that_of_an_export(store: Path, tmp_path: Path) -> None:
    import json

    from glint.storage.export.export import export

    export(Location.parse(store), "wine-glass", tmp_path / "out")
    for name in ("front", "phone"):
        written = json.loads((tmp_path / "out" / name / "report.json").read_text())
        assert json.loads(json.dumps(glint.open(store)["wine-glass"].latest[name].report)) == written


def test_a_notebook_shows_what_there_is(store: Path) -> None:
    opened = glint.open(store)
    assert repr(opened) == f"<Store {store}: 1 object: wine-glass>"
    assert repr(opened["wine-glass"]) == "<StoredObject 'wine-glass': 2 versions: v1, v2>"
    version = opened["wine-glass"].latest
    assert repr(version).startswith("<StoredVersion v2 of 'wine-glass', 20")
    assert repr(version).endswith("UTC: 2 captures: front, phone>")
    assert repr(version["front"]) == (
        "<StoredCapture 'front' of 'wine-glass' v2: 36 x 40 pixels, orthographic, 0.5 mm per pixel>"
    )
    assert repr(version["phone"].mesh).startswith("<Mesh of ")
    assert "frame 'camera'" in repr(version["front"].point_cloud())


def test_damage_is_refused(tmp_path: Path) -> None:
    from glint.storage.export.mesh_files import read_ply

    for data in (b"", b"ply\nformat ascii 1.0\nend_header\n", b"glTF"):
        with pytest.raises(StoreError, match="not a binary PLY"):
            read_ply(data, "mm", "front/surface.ply")
    header = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nelement face 1\n"
    header += b"property list uchar int vertex_indices\nend_header\n"
    with pytest.raises(StoreError, match="truncated"):
        read_ply(header + b"1234", "mm")
