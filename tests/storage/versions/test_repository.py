import hashlib
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import threading
import time
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import icechunk
import numpy as np
import pytest
import zarr

from glint.storage.errors import StoreError
from glint.storage.json_values import json_value
from glint.storage.locations.location import Location
from glint.storage.versions import publication
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT, FileInfo, StoredFile
from glint.storage.versions.stages.groups import LAYOUT_NUMBER
from glint.storage.versions.stages.writer import chunk_shape
from tests.polling import PATIENCE, has_grown, until
from tests.storage.stores import SCHEMAS, STAGES, MemoryLocation, capture_arrays, local_store, save_capture, small_ply

SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture
def location(tmp_path: Path) -> Location:
    return local_store(tmp_path / "store")


def folder_of(location: Location) -> Path:
    assert location.local is not None
    return location.local


@pytest.fixture
def repository(location: Location) -> ObjectRepository:
    return ObjectRepository.open(location, "duck")


def test_a_saved_stage_is_read_back_as_it_was(repository: ObjectRepository, location: Location) -> None:
    arrays = {
        "values": np.array([[1.0, np.nan], [np.inf, -2.0]], np.float32),
        "flags": np.array([True, False]),
        "none": np.zeros((0, 2), np.int32),
        "number": np.array(7, np.int16),
    }
    files = {"a.ply": StoredFile(b"mesh", "model/ply"), "Empty-1.txt": StoredFile(b"", "text/plain")}
    repository.save("front", "survey", "k1", arrays, {"share": np.float32(0.5), "bad": np.nan}, files)
    result = ObjectRepository.open(location, "duck", create=False).load("front", "survey")
    assert (result.key, result.record) == ("k1", {"share": 0.5, "bad": None})
    assert result.files == {
        name: FileInfo(len(file.data), hashlib.sha256(file.data).hexdigest(), file.media_type)
        for name, file in files.items()
    }
    assert {name: result.read_file(name) for name in files} == {name: file.data for name, file in files.items()}
    assert set(result.arrays) == set(arrays)
    for name, values in arrays.items():
        assert result.read(name).dtype == values.dtype
        np.testing.assert_array_equal(result.read(name), values)
    with pytest.raises(StoreError, match="no array 'other'"):
        result.read("other")
    with pytest.raises(StoreError, match=r"duck/front/survey has no file 'other\.ply', only Empty-1\.txt, a\.ply"):
        result.read_file("other.ply")


def test_a_new_repository_is_on_the_disk_with_the_folders_that_lead_to_it(
    location: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[Path] = []
    monkeypatch.setattr("glint.storage.fsync.flush", flushed.append)
    ObjectRepository.open(location, "duck")
    store = folder_of(location)
    repository = store / "objects" / "duck" / "repo"
    folders = {store.parent, store, store / "objects", store / "objects" / "duck", repository}
    assert folders | set(repository.rglob("*")) <= set(flushed)


def test_a_store_in_a_folder_that_cannot_be_opened_is_created(
    location: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flushed(path: Path) -> None:
        if path == folder_of(location).parent:
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("glint.storage.fsync.flush", flushed)
    assert ObjectRepository.open(location, "duck").captures() == []


def test_saving_again_replaces_the_whole_stage(repository: ObjectRepository) -> None:
    repository.save("front", "mask", "k1", {"old": np.ones(3)}, {"a": 1})
    repository.save("front", "mask", "k2", {"new": np.zeros(2)}, {})
    result = repository.load("front", "mask")
    assert (result.key, set(result.arrays), result.record, result.files) == ("k2", {"new"}, {}, {})


def test_absent_results_are_reported(repository: ObjectRepository, location: Location) -> None:
    assert repository.stage_key("front", "mask") is None
    assert repository.captures() == [] and repository.history() == []
    with pytest.raises(StoreError, match="no front/mask"):
        repository.load("front", "mask")
    with pytest.raises(StoreError, match="no version"):
        repository.load("front", "mask", "v3")
    with pytest.raises(StoreError, match="no version yet"):
        repository.version()
    with pytest.raises(StoreError, match="no object cup"):
        ObjectRepository.open(location, "cup", create=False)


@pytest.mark.parametrize("name", ["../out", "a/b", "", ".hidden", "A", "a" * 65, "a\nb"])
def test_names_cannot_leave_their_folder(repository: ObjectRepository, location: Location, name: str) -> None:
    before = sorted(folder_of(location).parent.rglob("*"))
    with pytest.raises(StoreError):
        ObjectRepository.open(location, name)
    with pytest.raises(StoreError):
        repository.save(name, "mask", "k", {}, {})
    with pytest.raises(StoreError):
        repository.save("front", name, "k", {}, {})
    assert [path for path in sorted(folder_of(location).parent.rglob("*")) if path.name != "repo.lock"] == [
        path for path in before if path.name != "repo.lock"
    ]


def test_no_capture_has_the_name_of_a_groups_metadata(repository: ObjectRepository, location: Location) -> None:
    for capture, stage in (("zarr.json", "mask"), ("front", "zarr.json")):
        with pytest.raises(StoreError, match=r"'zarr.json' cannot be a name in the store: .*, not zarr.json"):
            repository.save(capture, stage, "k", {}, {})
    assert ObjectRepository.open(location, "zarr.json").contents() == {}


def test_publishing_tags_and_moves_main(repository: ObjectRepository, location: Location) -> None:
    arrays = save_capture(repository, "front", "k1")
    assert repository.captures("main") == []
    version = repository.publish(["front"], {"run": "r1", "loss": np.float64(2.0)})
    assert version.created and version.name == "v1" and version.metadata == {"run": "r1", "loss": 2.0}
    for ref in ("main", "v1", version.snapshot):
        np.testing.assert_array_equal(
            repository.load("front", "depth", ref).read("depth"), arrays["depth"]["depth"], strict=True
        )
    plain = icechunk.Repository.open(location.child("objects", "duck", "repo").icechunk_storage())
    group = zarr.open_group(plain.readonly_session(tag="v1").store, mode="r")
    normals = group["front/labels/normals"]
    assert isinstance(normals, zarr.Array) and normals.shape == (12, 16, 3)
    assert plain.lookup_branch("main") == version.snapshot
    assert plain.list_branches() == {"main", "work"}


def test_publishing_the_same_results_again_makes_no_version(repository: ObjectRepository) -> None:
    save_capture(repository, "front", "k1")
    first = repository.publish(["front"], {"run": "r1"})
    save_capture(repository, "front", "k1")
    second = repository.publish(["front"], {"run": "r2"})
    assert not second.created and second.snapshot == first.snapshot and second.metadata == {"run": "r1"}
    assert [version.name for version in repository.history()] == ["v1"]


def _without(stage: str, name: str) -> dict[str, np.ndarray]:
    return {other: values for other, values in capture_arrays()[stage].items() if other != name}


def _damaged(stage: str, name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {**capture_arrays()[stage], name: values}


@pytest.mark.parametrize(
    ("stage", "arrays", "problem"),
    [
        ("labels", _without("labels", "normals"), "labels has no array normals"),
        ("depth", _damaged("depth", "depth", np.full((12, 16), np.nan, np.float32)), "values that are not finite"),
        ("depth", _damaged("depth", "depth", np.zeros((12, 15), np.float32)), "W is 16"),
        ("depth", _damaged("depth", "depth", np.zeros((12, 16), np.int32)), "is int32"),
        ("labels", _damaged("labels", "confidence", np.zeros(16, np.float32)), "has shape (16,), not (H, W)"),
        ("labels", _damaged("labels", "confidence", np.zeros((12, 16, 1), np.float32)), "(12, 16, 1), not (H, W)"),
        ("mask", {}, "mask has no array mask"),
        ("mask", {"mask": np.ones((12, 15), bool)}, "has shape (12, 16, 3), which does not fit (12, 15)"),
        ("lights", _damaged("lights", "half_vectors", np.full((20, 3), np.nan, np.float32)), "lights/half_vectors has"),
        ("lights", _damaged("lights", "lights", np.zeros((20, 2), np.float32)), "3 is 3"),
    ],
)
def test_a_malformed_result_is_not_published(
    repository: ObjectRepository, stage: str, arrays: dict[str, np.ndarray], problem: str
) -> None:
    save_capture(repository, "front", "k1")
    repository.publish(["front"], {}, STAGES, schemas=SCHEMAS)
    repository.save("front", stage, "k2", arrays, {})
    with pytest.raises(StoreError) as refusal:
        repository.publish(["front"], {}, STAGES, schemas=SCHEMAS)
    assert problem in refusal.value.message.replace("3 is 3 after its schema", "3 is 3")
    assert [version.name for version in repository.history()] == ["v1"]
    assert repository.stage_key("front", stage, "main") == "k1"


def test_a_missing_stage_is_not_published(repository: ObjectRepository) -> None:
    save_capture(repository, "front", "k1")
    repository.save("back", "mask", "k1", capture_arrays()["mask"], {})
    with pytest.raises(StoreError, match="stage depth is missing"):
        repository.publish(["front", "back"], {}, STAGES, schemas=SCHEMAS)
    with pytest.raises(StoreError, match="cannot be published: "):
        repository.publish(["nowhere"], {})


@pytest.mark.long
def test_captures_that_are_not_named_stay_as_they_were(repository: ObjectRepository) -> None:
    save_capture(repository, "front", "k1", seed=1)
    back = save_capture(repository, "back", "k1", seed=2)
    repository.publish(["front", "back"], {})
    front = save_capture(repository, "front", "k2", seed=3)
    repository.save("back", "mask", "k2", {"mask": np.zeros((3, 3), bool)}, {})
    repository.save("side", "mask", "k1", {"mask": np.zeros((3, 3), bool)}, {})
    version = repository.publish(["front"], {})
    assert version.name == "v2" and repository.captures("v2") == ["back", "front"]
    np.testing.assert_array_equal(repository.load("back", "mask", "v2").read("mask"), back["mask"]["mask"])
    assert repository.load("back", "surface", "v2").read_file("surface.ply") == small_ply(2)
    np.testing.assert_array_equal(repository.load("front", "depth", "v2").read("depth"), front["depth"]["depth"])
    assert repository.stage_key("back", "mask") == "k2", "work goes on where it was"
    assert repository.publish(["front"], {}, remove=["back"]).name == "v3"
    assert repository.captures("v3") == ["front"]


@pytest.mark.long
def test_a_rollback_is_a_version_and_stands_until_something_changes(repository: ObjectRepository) -> None:
    first = save_capture(repository, "front", "k1", seed=1)
    repository.publish(["front"], {"run": "r1"})
    save_capture(repository, "front", "k2", seed=2)
    repository.publish(["front"], {"run": "r2"})
    rolled = repository.rollback("v1")
    assert rolled.created and rolled.name == "v3"
    assert rolled.metadata == {"run": "r1", "rolled_back_to": "v1", "replaces": "v2"}
    np.testing.assert_array_equal(repository.load("front", "depth", "main").read("depth"), first["depth"]["depth"])
    assert not repository.publish(["front"], {"run": "r3"}).created, "the same results were rolled back from"
    for name in ("v3", "v1"):
        again = repository.rollback(name)
        assert (again.name, again.created) == ("v3", False), "it has the content of v1 already"
    third = save_capture(repository, "front", "k3", seed=3)
    assert repository.publish(["front"], {"run": "r4"}).name == "v4"
    np.testing.assert_array_equal(repository.load("front", "depth", "main").read("depth"), third["depth"]["depth"])
    assert [version.name for version in repository.history()] == ["v1", "v2", "v3", "v4"]
    assert repository.load("front", "depth", "v2").key == "k2", "what was replaced can still be read"
    with pytest.raises(StoreError, match="no version 'v9'"):
        repository.rollback("v9")


def test_rollbacks_add_up_until_something_changes(repository: ObjectRepository) -> None:
    for key in ("k1", "k2", "k3"):
        repository.save("front", "labels", key, {}, {})
        repository.save("back", "labels", "k1", {}, {})
        repository.publish(["front", "back"], {})
    repository.rollback("v2")
    assert repository.rollback("v1").rolled_back == {"front": [{"labels": "k3"}, {"labels": "k2"}]}
    repository.save("back", "labels", "k2", {}, {})
    assert repository.publish(["front", "back"], {}).name == "v6"
    back = repository.rollback("v5")
    assert back.stages == {"front": {"labels": "k1"}, "back": {"labels": "k1"}}
    for key in ("k3", "k2"):
        repository.save("front", "labels", key, {}, {})
        assert not repository.publish(["front", "back"], {}).created, "work holds what was rolled back"
    repository.save("front", "labels", "k4", {}, {})
    version = repository.publish(["front", "back"], {})
    assert version.stages["front"] == {"labels": "k4"} and version.rolled_back == {"back": [{"labels": "k2"}]}


def test_a_rollback_that_is_not_recorded_as_a_list_stands(
    repository: ObjectRepository, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("k1", "k2"):
        repository.save("front", "labels", key, {}, {})
        repository.publish(["front"], {})
    monkeypatch.setattr(publication, "_rolled_back", lambda current, target: current.stages)
    assert repository.rollback("v1").rolled_back == {"front": [{"labels": "k2"}]}
    assert not repository.publish(["front"], {}).created


def test_a_rollback_replaces_a_damaged_version_of_the_same_content(
    repository: ObjectRepository, location: Location
) -> None:
    save_capture(repository, "front", "k1", seed=1)
    repository.publish(["front"], {})
    save_capture(repository, "front", "k2", seed=2)
    repository.publish(["front"], {})
    assert repository.rollback("v1").name == "v3"
    for chunk in (folder_of(location) / "objects" / "duck" / "repo" / "chunks").iterdir():
        data = bytearray(chunk.read_bytes())
        data[len(data) // 2] ^= 1
        chunk.write_bytes(data)
    assert repository.rollback("v1").name == "v4"


def test_results_of_the_whole_object_are_no_capture(repository: ObjectRepository, location: Location) -> None:
    save_capture(repository, "front", "k1")
    repository.save(WHOLE_OBJECT, "model", "m", {}, {}, {"model.ply": StoredFile(b"ply", "model/ply")})
    version = repository.publish(["front", WHOLE_OBJECT], {})
    assert repository.captures(version.name) == ["front"]
    assert repository.load(WHOLE_OBJECT, "model", "main").read_file("model.ply") == b"ply"


def test_main_follows_a_tag_whose_publisher_died(repository: ObjectRepository, location: Location) -> None:
    save_capture(repository, "front", "k1")
    first = repository.publish(["front"], {})
    save_capture(repository, "front", "k2")
    repository.publish(["front"], {})
    inner = icechunk.Repository.open(location.child("objects", "duck", "repo").icechunk_storage())
    inner.reset_branch("main", first.snapshot)
    assert not repository.publish(["front"], {}).created
    assert repository.stage_key("front", "mask", "main") == "k2"


def test_an_interrupted_creation_of_the_repository_does_no_harm(location: Location) -> None:
    folder = folder_of(location) / "objects" / "duck" / "repo"
    ObjectRepository.open(location, "duck")
    (folder / "repo").unlink()
    repository = ObjectRepository.open(location, "duck")
    repository.save("front", "mask", "k1", {}, {})
    repository.save("front", "mask", "k2", {}, {})
    (folder / "repo").unlink()
    with pytest.raises(StoreError, match=r"its file `repo` is lost.*verify duck --repair"):
        ObjectRepository.open(location, "duck")
    newest = max((folder / "overwritten").iterdir(), key=lambda path: path.stat().st_mtime_ns)
    newest.rename(folder / "repo")
    assert ObjectRepository.open(location, "duck").stage_key("front", "mask") in ("k1", "k2")


@pytest.mark.long
def test_collecting_garbage_keeps_versions_and_work(repository: ObjectRepository, location: Location) -> None:
    old = save_capture(repository, "front", "k1", seed=1)
    repository.publish(["front"], {})
    for seed in range(4):
        repository.save("front", "extra", f"e{seed}", {"noise": np.random.default_rng(seed).random((99, 99))}, {})
    save_capture(repository, "front", "k2", seed=2)
    files = {path for path in folder_of(location).rglob("*") if path.is_file()}
    repository.garbage_collect(dry_run=True, min_age=timedelta(0))
    assert {path for path in folder_of(location).rglob("*") if path.is_file()} == files
    garbage = repository.garbage_collect(min_age=timedelta(0))
    assert garbage.bytes > 3 * 70_000 and garbage.objects > 3
    again = ObjectRepository.open(location, "duck", create=False)
    np.testing.assert_array_equal(again.load("front", "depth", "v1").read("depth"), old["depth"]["depth"])
    assert again.load("front", "extra").read("noise").shape == (99, 99)
    assert again.publish(["front"], {}).name == "v2"
    assert repository.garbage_collect().objects == 0, "younger than a day"


def _save_many(location: Location, worker: int, saves: int) -> None:
    repository = ObjectRepository.open(location, "duck")
    for number in range(saves):
        repository.save(f"capture-{worker}", f"stage-{number}", "k", {"a": np.full(9, worker * 100 + number)}, {})
        repository.save("shared", f"stage-{worker}-{number}", "k", {"a": np.full(9, worker * 100 + number)}, {})


@pytest.mark.parametrize("file", [False, True])
def test_a_flipped_bit_and_a_lost_chunk_are_refused(
    repository: ObjectRepository, location: Location, file: bool
) -> None:
    noise = np.random.default_rng(0).integers(0, 256, 5000, np.uint8)
    arrays, files = ({}, {"noise": StoredFile(noise.tobytes(), "text/plain")}) if file else ({"noise": noise}, {})
    repository.save("front", "extra", "k", arrays, {}, files)

    def read() -> bytes:
        result = ObjectRepository.open(location, "duck").load("front", "extra")
        return result.read_file("noise") if file else result.read("noise").tobytes()

    assert read() == noise.tobytes()
    (chunk,) = (folder_of(location) / "objects" / "duck" / "repo" / "chunks").iterdir()
    stored = chunk.read_bytes()
    for position in (0, 16, 2000, len(stored) - 1):
        damaged = bytearray(stored)
        damaged[position] ^= 1
        chunk.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"'noise' of duck/front/extra is damaged.*checksum.*verify duck.*backup"):
            read()
    chunk.unlink()
    with pytest.raises(StoreError, match=r"'noise' of duck/front/extra is damaged"):
        read()


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({}, "an older version of Glint .layout 1; .* use a new --store and run again"),
        ({"version": "v3", "metadata": {}}, "an older version of Glint .layout 1; "),
        ({"layout": LAYOUT_NUMBER + 1}, "a newer version of Glint .layout 4; .* update Glint"),
    ],
)
def test_another_layout_is_refused_with_a_remedy(location: Location, attributes: dict[str, Any], message: str) -> None:
    storage = location.child("objects", "duck", "repo").icechunk_storage()
    inner = icechunk.Repository.create(storage)
    inner.create_branch("work", inner.lookup_branch("main"))
    session = inner.writable_session("work")
    zarr.create_group(session.store, attributes=attributes)
    session.commit("front/mask")
    for create in (True, False):
        with pytest.raises(StoreError, match=f"object duck in .* was written by {message}"):
            ObjectRepository.open(location, "duck", create)


def test_work_and_versions_record_the_layout_number(repository: ObjectRepository, location: Location) -> None:
    save_capture(repository, "front", "k1")
    repository.publish(["front"], {})
    inner = icechunk.Repository.open(location.child("objects", "duck", "repo").icechunk_storage())
    for session in (inner.readonly_session("work"), inner.readonly_session(tag="v1")):
        assert zarr.open_group(session.store, mode="r").attrs["layout"] == LAYOUT_NUMBER == 3


@pytest.mark.long
def test_four_processes_lose_nothing(location: Location) -> None:
    processes = [SPAWN.Process(target=_save_many, args=(location, worker, 5)) for worker in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(timeout=120)
    assert [process.exitcode for process in processes] == [0] * 4
    repository = ObjectRepository.open(location, "duck", create=False)
    for worker in range(4):
        for number in range(5):
            for capture, stage in ((f"capture-{worker}", f"stage-{number}"), ("shared", f"stage-{worker}-{number}")):
                assert (repository.load(capture, stage).read("a") == worker * 100 + number).all()


@pytest.mark.long
def test_writers_without_a_lock_try_again_and_lose_nothing() -> None:
    location, failures = MemoryLocation(), []

    def work(writer: int) -> None:
        try:
            repository = ObjectRepository.open(location, "duck")
            for number in range(4):
                repository.save("shared", f"stage-{writer}-{number}", "k", {"a": np.full(9, writer)}, {})
            save_capture(repository, f"view-{writer}", "k", seed=writer)
            repository.publish([f"view-{writer}"], {})
        except Exception as error:
            failures.append(error)

    writers = [threading.Thread(target=work, args=(writer,)) for writer in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert not failures
    repository = ObjectRepository.open(location, "duck", create=False)
    assert len(repository.contents()["shared"]) == 16
    assert [len(version.stages) for version in repository.history()] == [1, 2, 3, 4]
    assert repository.captures("main") == [f"view-{writer}" for writer in range(4)]


def _publish_for_ever(location: Location, acknowledged: Path, start: int) -> None:
    repository = ObjectRepository.open(location, "duck")
    for round_ in range(start, start + 10_000):
        save_capture(repository, "front", f"k{round_}", seed=round_)
        version = repository.publish(["front"], {"round": round_})
        with acknowledged.open("a") as file:
            file.write(f"{version.name} {version.metadata['round']}\n")


@pytest.mark.long
def test_a_killed_process_leaves_whole_versions(location: Location, tmp_path: Path) -> None:
    acknowledged, chance = tmp_path / "acknowledged", random.Random(0)
    for attempt in range(4):
        lines = acknowledged.read_text().count("\n") if acknowledged.exists() else 0
        worker = SPAWN.Process(target=_publish_for_ever, args=(location, acknowledged, attempt * 10_000))
        worker.start()
        until(partial(has_grown, acknowledged, lines), pause=0.01)
        time.sleep(chance.uniform(0.0, 0.3))
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        worker.join()
        repository = ObjectRepository.open(location, "duck", create=False)
        history = {version.name: version for version in repository.history()}
        for line in acknowledged.read_text().splitlines():
            name, round_ = line.split()
            assert history[name].metadata == {"round": int(round_)}, "what was acknowledged is there"
        for version in [*list(history.values())[-3:], repository.version()]:
            expected = capture_arrays(version.metadata["round"])
            for stage, arrays in expected.items():
                result = repository.load("front", stage, version.name)
                assert result.key == f"k{version.metadata['round']}"
                for name, values in arrays.items():
                    np.testing.assert_array_equal(result.read(name), values)
        assert {version.name for version in history.values()} == {f"v{n + 1}" for n in range(len(history))}
    save_capture(repository, "front", "last", seed=5)
    assert repository.publish(["front"], {"round": -1}).created, "and it goes on"
    assert repository.stage_key("front", "mask", "main") == "last"


def test_a_store_below_a_file_is_refused_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="name another store"):
        ObjectRepository.open(local_store(tmp_path / "file" / "store"), "duck")


def _save_with_little_room(location: Location, outcome: Path) -> None:
    repository = ObjectRepository.open(location, "duck")
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
    try:
        repository.save("front", "noise", "k2", {"a": np.random.default_rng(0).random((300, 300))}, {})
    except StoreError as error:
        outcome.write_text(error.remedy)


@pytest.mark.long
def test_a_file_that_cannot_grow_is_a_store_error_and_loses_nothing(location: Location, tmp_path: Path) -> None:
    repository = ObjectRepository.open(location, "duck")
    repository.save("front", "noise", "k1", {"a": np.ones(3)}, {})
    worker = SPAWN.Process(target=_save_with_little_room, args=(location, tmp_path / "outcome"))
    worker.start()
    worker.join(timeout=PATIENCE)
    assert "free space" in (tmp_path / "outcome").read_text()
    assert repository.load("front", "noise").key == "k1"


def test_a_full_disk_is_a_store_error_and_loses_nothing(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)], capture_output=True)
    if mounted.returncode:
        pytest.skip("may not mount a small disk here")
    try:
        location = local_store(disk / "store")
        repository = ObjectRepository.open(location, "duck")
        repository.save("front", "noise", "k1", {"a": np.ones(3)}, {})
        with pytest.raises(StoreError, match="free space"):
            repository.save("front", "noise", "k2", {"a": np.random.default_rng(0).random((400, 400))}, {})
        assert ObjectRepository.open(location, "duck").load("front", "noise").key == "k1"
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_chunks_are_bounded_and_whole_where_they_can_be() -> None:
    assert chunk_shape((3, 221, 251, 3), 4) == (3, 221, 251, 3)
    assert chunk_shape((0, 2), 4) == (1, 2) and chunk_shape((), 4) == ()
    for shape in ((3, 2000, 2000, 3), (100_000, 3), (2000, 2000)):
        assert 1 << 20 <= np.prod(chunk_shape(shape, 4)) * 4 <= 4 << 20 or np.prod(shape) * 4 < 4 << 20


def test_records_become_json() -> None:
    record = {"path": Path("a"), "set": {2, 1}, "array": np.array([1.0, np.inf]), 3: (np.int64(4), None, True)}
    assert json_value(record) == {"path": "a", "set": [1, 2], "array": [1.0, None], "3": [4, None, True]}
    with pytest.raises(TypeError):
        json_value({"what": object()})
