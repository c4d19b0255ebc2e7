import csv
import io
import json
from pathlib import Path

import icechunk
import numpy as np
import pytest
import tifffile
import trimesh
import zarr

from glint.storage.errors import OutputError, StoreError
from glint.storage.export.export import export, export_page
from glint.storage.export.mesh_files import with_asset_facts
from glint.storage.locations.location import Location
from glint.storage.seals import sealed
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT, StoredFile
from tests.storage.export.image_readers import read_exr, read_png
from tests.storage.stores import PIXEL, PROVENANCE, REASONS, capture_arrays, local_store, save_capture, small_ply

FILES = {
    *("normals.npy", "normals.png", "normals.exr", "initial_normals.npy", "depth.npy", "depth.tiff", "mask.png"),
    *(
        "observed.png",
        "provenance.png",
        "provenance.json",
        "depth_provenance.png",
        "depth_provenance.json",
        "confidence.npy",
        "lights.lp",
        "half_vectors.npy",
    ),
    *("frames.csv", "surface.ply", "relit_left.png", "report.json", "report.html"),
}


@pytest.fixture
def location(tmp_path: Path) -> Location:
    return local_store(tmp_path / "store")


@pytest.fixture
def repository(location: Location) -> ObjectRepository:
    repository = ObjectRepository.open(location, "duck")
    save_capture(repository, "front", "k1")
    return repository


def test_every_file_holds_what_was_stored(repository: ObjectRepository, location: Location, tmp_path: Path) -> None:
    repository.publish(["front"], {"run": "r1"})
    record = export(location, "duck", tmp_path / "out")
    folder, arrays = tmp_path / "out" / "front", capture_arrays()
    assert {path.name for path in folder.iterdir()} == FILES and record.files == len(FILES)
    assert (record.version, record.captures) == ("v1", ("front",))
    assert record.size == sum(path.stat().st_size for path in folder.iterdir())
    normals, mask = arrays["labels"]["normals"], arrays["mask"]["mask"]
    for name, expected in {
        "normals": normals,
        "initial_normals": arrays["silhouette"]["initial"],
        "depth": arrays["depth"]["depth"],
        "confidence": arrays["labels"]["confidence"],
        "half_vectors": arrays["lights"]["half_vectors"],
    }.items():
        values = np.load(folder / f"{name}.npy")
        assert values.dtype == np.float32
        np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(read_exr(folder / "normals.exr"), normals)
    np.testing.assert_array_equal(tifffile.imread(folder / "depth.tiff"), arrays["depth"]["depth"])
    picture = read_png(folder / "normals.png")
    assert picture.dtype == np.uint16 and not picture[~mask].any()
    np.testing.assert_array_equal(picture[mask], np.rint((normals[mask].astype(float) + 1) / 2 * 65535))
    np.testing.assert_array_equal(read_png(folder / "mask.png") > 0, mask)
    observed = (arrays["clusters"]["observations"] > 0) & mask
    assert not np.array_equal(observed, mask)
    np.testing.assert_array_equal(read_png(folder / "observed.png") > 0, observed)
    np.testing.assert_array_equal(read_png(folder / "provenance.png"), arrays["labels"]["provenance"])
    np.testing.assert_array_equal(read_png(folder / "depth_provenance.png"), arrays["depth"]["provenance"])
    codes = json.loads((folder / "provenance.json").read_text())
    assert codes == {str(code): name for code, name in enumerate(PROVENANCE)}
    assert (folder / "surface.ply").read_bytes() == small_ply() and (folder / "relit_left.png").read_bytes() == PIXEL


def test_lights_and_frames_are_listed(repository: ObjectRepository, location: Location, tmp_path: Path) -> None:
    repository.publish(["front"], {})
    export(location, "duck", tmp_path / "out")
    lights = capture_arrays()["lights"]
    count, *lines = (tmp_path / "out/front/lights.lp").read_text().splitlines()
    assert int(count) == len(lines) == 18
    for line in lines:
        name, *direction = line.split()
        assert len(name) == 6 and int(name) not in (3, 7)
        np.testing.assert_allclose(np.array(direction, float), lights["lights"][int(name)], atol=1e-6)
    with (tmp_path / "out/front/frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 20 and rows[0] == {"frame": "0", "accepted": "true", "reason": ""}
    assert [rows[frame]["reason"] for frame in (3, 7)] == [*REASONS[1:]]
    assert rows[3]["accepted"] == "false"


def test_the_reports_show_figures_and_warnings(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    repository.publish(["front"], {"run": "r1", "note": "<script>alert(1)</script>"})
    export(location, "duck", tmp_path / "out")
    report = json.loads((tmp_path / "out/front/report.json").read_text())
    arrays = capture_arrays()
    mask = arrays["mask"]["mask"]
    assert report["region"] == {"x": 5, "y": 6, "width": 16, "height": 12}
    assert report["depth"]["unit"] == "mm" and report["depth"]["direction"] == "towards the camera"
    assert report["version"]["name"] == "v1" and report["version"]["metadata"]["run"] == "r1"
    assert report["seconds"] == {"lights": 1.5} and report["parameters"] == {"labels": {"method": "paper"}}
    assert report["fingerprints"]["depth"] == "k1"
    counts = report["counts"]
    assert counts["pixels"] == mask.sum()
    assert counts["observed_pixels"] == ((arrays["clusters"]["observations"] > 0) & mask).sum()
    assert sum(counts["provenance"].values()) == mask.sum()
    assert (counts["frames"], counts["accepted_frames"]) == (20, 18)
    assert counts["rejected_frames"] == {"no light": 1, "two lights": 1}
    page = (tmp_path / "out/front/report.html").read_text()
    assert "few &lt;b&gt;lights&lt;/b&gt;" in page and "<script>alert" not in page


def test_a_page_for_others_names_files_without_their_folders(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    entry = {"id": "front", "frames": "/home/anna/lab/front.mp4", "mask": "s3://lab-secret/duck/mask.png"}
    recorded = {"front": {"catalogue": "/home/anna/lab/glass.yaml", "entry": entry}}
    repository.publish(["front"], {"catalogue": "/home/anna/lab/glass.yaml", "captures": recorded})
    page = Path(export_page(location, "duck", tmp_path / "page.html").out).read_text()
    assert "front.mp4" in page and "mask.png" in page and "glass.yaml" in page
    assert "anna" not in page and "secret" not in page
    export(location, "duck", tmp_path / "out")
    assert "/home/anna/lab/front.mp4" in (tmp_path / "out/front/report.json").read_text(), "files keep the addresses"


@pytest.mark.long
def test_any_version_can_be_exported(repository: ObjectRepository, location: Location, tmp_path: Path) -> None:
    repository.publish(["front"], {})
    save_capture(repository, "front", "k2", seed=2)
    with pytest.raises(StoreError, match="no version 'v2'"):
        export(location, "duck", tmp_path / "none", "v2")
    assert not (tmp_path / "none").exists()
    repository.publish(["front"], {})
    for version, seed in (("v1", 0), ("v2", 2), (None, 2)):
        export(location, "duck", tmp_path / "out", version)
        np.testing.assert_array_equal(np.load(tmp_path / "out/front/depth.npy"), capture_arrays(seed)["depth"]["depth"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "store"], "nothing is left beside"


def test_the_model_is_exported_beside_the_captures(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    repository.save(WHOLE_OBJECT, "model", "m", {}, {}, {"model.ply": StoredFile(b"model", "model/ply")})
    repository.publish(["front", WHOLE_OBJECT], {})
    export(location, "duck", tmp_path / "out")
    assert (tmp_path / "out/model.ply").read_bytes() == b"model"


@pytest.mark.long
def test_captures_of_an_older_export_are_removed_and_other_files_stay(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    save_capture(repository, "back", "k1")
    repository.publish(["front", "back"], {})
    export(location, "duck", tmp_path / "out")
    (tmp_path / "out/mine").mkdir()
    (tmp_path / "out/notes.txt").write_text("mine")
    repository.publish([], {}, remove=["back"])
    export(location, "duck", tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["front", "mine", "notes.txt"]


def test_a_folder_that_is_not_an_export_is_left_alone(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    repository.publish(["front"], {})
    (tmp_path / "out/front").mkdir(parents=True)
    (tmp_path / "out/front/thesis.txt").write_text("mine")
    with pytest.raises(StoreError, match="is not an export of duck"):
        export(location, "duck", tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").rglob("*")] == ["front", "thesis.txt"]


@pytest.mark.long
def test_damaged_or_hostile_content_leaves_nothing(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    file = StoredFile(b"ply", "model/ply")
    repository.save("front", "surface", "twice", {}, {}, {"report.json": file})
    repository.publish(["front"], {})
    with pytest.raises(StoreError, match=r"names a file 'report\.json' twice"):
        export(location, "duck", tmp_path / "out")
    inner = icechunk.Repository.open(location.child("objects", "duck", "repo").icechunk_storage())
    for number, name in enumerate((".bashrc", "..escape", "x\x00y")):
        repository.save("front", "surface", f"bad{number}", {}, {}, {"surface.ply": file})
        session = inner.writable_session("work")
        group = zarr.open_group(session.store, path="front/surface")
        attributes = dict(group.attrs)
        files = attributes["files"]
        assert isinstance(files, dict)
        files[name] = files["surface.ply"]
        group.attrs.put(sealed(attributes))
        session.commit("foreign")
        repository.publish(["front"], {})
        with pytest.raises(StoreError, match="names a file"):
            export(location, "duck", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_a_file_whose_content_was_replaced_is_refused(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    inner = icechunk.Repository.open(location.child("objects", "duck", "repo").icechunk_storage())
    session = inner.writable_session("work")
    content = zarr.open_group(session.store, path="front/surface/files")["surface.ply"]
    assert isinstance(content, zarr.Array)
    content[2] = ord("x")
    session.commit("damage")
    repository.publish(["front"], {})
    with pytest.raises(StoreError, match=r"'surface\.ply' of duck/front/surface in v\d is damaged"):
        export(location, "duck", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_optional_results_may_be_absent_and_required_ones_may_not(location: Location, tmp_path: Path) -> None:
    repository = ObjectRepository.open(location, "cup")
    arrays = capture_arrays()
    repository.save("front", "mask", "k", arrays["mask"], {})
    repository.publish(["front"], {}, required=["mask"])
    with pytest.raises(StoreError, match="has no labels"):
        export(location, "cup", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    repository.save("front", "labels", "k", arrays["labels"], {})
    repository.publish(["front"], {}, required=["mask"])
    export(location, "cup", tmp_path / "out")
    names = {path.name for path in (tmp_path / "out/front").iterdir()}
    assert {"normals.npy", "provenance.json", "report.html"} <= names and "depth.npy" not in names


def test_a_folder_that_cannot_be_written_is_an_error_of_the_output(
    repository: ObjectRepository, location: Location, tmp_path: Path
) -> None:
    repository.publish(["front"], {})
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"exporting duck to .*file/out failed"):
        export(location, "duck", tmp_path / "file" / "out")


def test_a_glb_names_its_object_and_version() -> None:
    scene = trimesh.Scene(trimesh.creation.box())
    data = with_asset_facts(bytes(scene.export(file_type="glb")), {"object": "Löffel", "version": "v2"})
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert tree["asset"]["extras"] == {"object": "Löffel", "version": "v2"}
    assert int.from_bytes(data[8:12], "little") == len(data) and len(data) % 4 == 0
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type="glb")
    assert len(mesh.faces) == 12 and mesh.volume == pytest.approx(1.0)


@pytest.mark.parametrize("data", [b"", b"glTF", b"glTF" + bytes(40)])
def test_what_is_no_glb_is_refused(data: bytes) -> None:
    with pytest.raises(StoreError, match="not a binary glTF file"):
        with_asset_facts(data, {})
