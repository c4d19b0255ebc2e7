"""The store's promises on real object stores: Ceph's S3 gateway and the Azure emulator, whichever is installed."""

import os
import subprocess
import sys
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from uuid import uuid4

import numpy as np
import obstore
import pytest

from glint.storage.catalogue.loading import Region, from_folder, load, write
from glint.storage.errors import GlintError, InputError, StoreError
from glint.storage.export.export import export
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache, cache_digest
from glint.storage.frames.eviction import cached_frames, mark_used, remove_frames
from glint.storage.inputs.digests import content_digest
from glint.storage.locations.conditional_writes import check_conditional_writes
from glint.storage.locations.location import Location
from glint.storage.locations.store_folder import check_store
from glint.storage.locking.locks import run_lock, run_owner
from glint.storage.locking.owner import ObjectBusy
from glint.storage.versions.repository import ObjectRepository, object_ids
from glint.storage.versions.stage_results import StoredFile
from tests.s3_gateway import Gateway, free_port
from tests.storage.footage.videos import ramp, write_images, write_video
from tests.storage.locations.lax_server import lax_server
from tests.storage.stores import save_capture

pytestmark = [pytest.mark.slow, pytest.mark.server]

ROOT = Path(__file__).parents[2]
FRAMES = [ramp(index, 48, 64) for index in range(150)]


@pytest.fixture(params=["s3", "azure"])
def location(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Location:
    """A prefix of its own on a running server, credentials in the environment."""
    server = request.getfixturevalue(request.param)
    for name in [name for name in os.environ if name.startswith(("AWS_", "AZURE_"))]:
        monkeypatch.delenv(name)
    for name, value in server.environment.items():
        monkeypatch.setenv(name, value)
    scheme = {"s3": "s3", "azure": "az"}[request.param]
    return Location.parse(f"{scheme}://store/{uuid4().hex}")


@pytest.fixture
def lax_store(monkeypatch: pytest.MonkeyPatch) -> Iterator[Location]:
    """A store on a server that takes every write, whatever its condition."""
    with lax_server() as server:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            monkeypatch.setenv(name, "any")
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        yield Location.parse("s3://store/here")


def keys(location: Location) -> list[str]:
    return sorted(meta["path"] for batch in obstore.list(location.obstore()) for meta in batch)


def upload(folder: Path, location: Location) -> None:
    store = location.obstore()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            obstore.put(store, path.relative_to(folder).as_posix(), path.read_bytes())


def test_a_store_with_conditional_writes_passes_and_stays_clean(location: Location) -> None:
    check_conditional_writes(location)
    assert keys(location) == []


def test_a_store_that_ignores_conditions_is_refused(lax_store: Location) -> None:
    with pytest.raises(StoreError, match="should only create"):
        check_conditional_writes(lax_store)


def test_versions_history_rollback_export_and_garbage(location: Location, tmp_path: Path) -> None:
    repository = ObjectRepository.open(location, "duck")
    first = save_capture(repository, "front", "1", seed=1)
    assert repository.publish(["front"], {"run": "one"}).name == "v1"
    save_capture(repository, "front", "2", seed=2)
    assert repository.publish(["front"], {"run": "two"}).name == "v2"
    assert repository.publish(["front"], {"run": "three"}).created is False
    back = repository.rollback("v1")
    assert [version.name for version in repository.history()] == ["v1", "v2", "v3"]
    assert (back.name, back.metadata["rolled_back_to"]) == ("v3", "v1")
    again = ObjectRepository.open(location, "duck", create=False)
    np.testing.assert_array_equal(again.load("front", "labels", "main").read("normals"), first["labels"]["normals"])
    removed = again.garbage_collect(min_age=timedelta(0))
    assert removed.objects > 0
    np.testing.assert_array_equal(again.load("front", "labels", "v1").read("normals"), first["labels"]["normals"])
    again.load("front", "labels", "v2").read("normals")
    record = export(location, "duck", tmp_path / "out", "v1")
    assert record.version == "v1"
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "front" / "normals.npy"), first["labels"]["normals"])
    assert object_ids(location) == ["duck"]


def test_nothing_is_left_of_removed_frames(location: Location) -> None:
    for digest in ("a" * 64, "b" * 64):
        obstore.put(location.obstore(), f"frames/{digest}/zarr.json", b"{}")
        obstore.put(location.obstore(), f"frames/{digest}/object/c/0", b"frames")
    mark_used(location, "a" * 64)
    remove_frames(location, cached_frames(location))
    assert keys(location) == []


SAVE = """
import sys
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.storage.stores import save_capture
repository = ObjectRepository.open(Location.parse(sys.argv[1]), "duck")
save_capture(repository, sys.argv[2], "key", seed=int(sys.argv[3]))
repository.publish([sys.argv[2]], {})
"""


def test_processes_that_commit_at_once_lose_nothing(location: Location) -> None:
    names = [f"view-{index}" for index in range(4)]
    processes = [
        subprocess.Popen([sys.executable, "-c", SAVE, location.uri, name, str(index)], cwd=ROOT)
        for index, name in enumerate(names)
    ]
    assert [process.wait(120) for process in processes] == [0] * 4
    repository = ObjectRepository.open(location, "duck", create=False)
    assert repository.captures() == names
    assert [version.name for version in repository.history()] == ["v1", "v2", "v3", "v4"]
    assert repository.captures("main") == names


def test_damaged_and_lost_chunks_of_a_file_are_refused(location: Location) -> None:
    mesh = np.random.default_rng(0).bytes(5000)
    repository = ObjectRepository.open(location, "duck")
    repository.save("front", "surface", "k", {}, {}, {"surface.ply": StoredFile(mesh, "model/ply")})
    (chunk,) = (key for key in keys(location) if "/chunks/" in key)
    result = ObjectRepository.open(location, "duck").load("front", "surface")
    assert result.read_file("surface.ply") == mesh
    content = bytearray(obstore.get(location.obstore(), chunk).bytes())
    content[1000] ^= 1
    obstore.put(location.obstore(), chunk, bytes(content))
    with pytest.raises(StoreError, match=r"duck/front/surface is damaged"):
        ObjectRepository.open(location, "duck").load("front", "surface").read_file("surface.ply")
    obstore.delete(location.obstore(), chunk)
    with pytest.raises(StoreError, match=r"duck/front/surface is damaged"):
        ObjectRepository.open(location, "duck").load("front", "surface").read_file("surface.ply")


def test_a_lease_keeps_the_second_run_out_until_it_is_released(location: Location) -> None:
    with run_lock(location, "duck", run="nightly"):
        with pytest.raises(ObjectBusy, match="run nightly"), run_lock(location, "duck"):
            pass
        owner = run_owner(location, "duck")
        assert owner is not None and owner.run == "nightly"
    assert run_owner(location, "duck") is None and keys(location) == []
    with run_lock(location, "duck", run="next"):
        pass


def test_the_lease_of_a_killed_run_is_taken_over(location: Location) -> None:
    code = (
        "import os, sys, glint.storage.locking.locks as l, glint.storage.locations.location as p\n"
        "with l.run_lock(p.Location.parse(sys.argv[1]), 'duck', 'killed'): os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", code, location.uri], cwd=ROOT).returncode == -9
    assert keys(location) == ["objects/duck/run.json"]
    with run_lock(location, "duck", run="next"):
        owner = run_owner(location, "duck")
        assert owner is not None and owner.run == "next"


def test_frames_of_a_video_in_a_bucket_are_cached_there(location: Location, tmp_path: Path) -> None:
    video = write_video(tmp_path / "video.mp4", FRAMES)
    upload(tmp_path, location.child("in"))
    remote = location.child("in", "video.mp4")
    crops = {"object": Region(x=8, y=4, width=40, height=32)}
    with open_footage(remote) as footage, open_footage(video) as local:
        assert footage.count == local.count
        digest = cache_digest(content_digest(remote, location), crops)
        cache = FrameCache.ingest(footage, location, digest, crops)
        expected = np.stack([frame[4:36, 8:48] for frame in local.frames()])
    assert cache.complete
    np.testing.assert_array_equal(cache.read("object"), expected)
    np.testing.assert_array_equal(FrameCache.open(location, digest).read("object", slice(64, 128)), expected[64:128])


def test_a_digest_is_remembered_by_the_entity_tag(
    location: Location, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    video = location.child("video.mp4")
    obstore.put(location.obstore(), "video.mp4", b"one")
    first = content_digest(video, location)
    with monkeypatch.context() as patch:
        patch.setattr("glint.storage.inputs.digests._sha256", lambda file: pytest.fail("read again"))
        assert content_digest(video, location) == first
    obstore.put(location.obstore(), "video.mp4", b"two")
    assert content_digest(video, location) != first
    with pytest.raises(InputError, match="does not exist"):
        content_digest(location.child("none.mp4"), location)


def test_a_folder_of_captures_in_a_bucket_becomes_a_catalogue(location: Location, tmp_path: Path) -> None:
    for name in ("Duck [1]", "glass/truth"):
        (tmp_path / name).mkdir(parents=True)
    write_video(tmp_path / "Duck [1]" / "front.mp4", FRAMES[:4])
    (tmp_path / "Duck [1]" / "mask.png").write_bytes(b"")
    write_images(tmp_path / "glass" / "frames", FRAMES[:12])
    write_images(tmp_path / "glass" / "frames", FRAMES[:1], "img_{} (1).png")
    (tmp_path / "glass" / "truth" / "normals.npy").write_bytes(b"")
    upload(tmp_path, location)
    catalogue = from_folder(location)
    assert {item.id: [capture.id for capture in item.captures] for item in catalogue.objects} == {
        "duck-1": ["front"],
        "glass": ["front"],
    }
    duck, glass = (item.captures[0] for item in catalogue.objects)
    assert (duck.frames, duck.mask) == (f"{location.uri}/Duck [1]/front.mp4", f"{location.uri}/Duck [1]/mask.png")
    assert glass.truth == f"{location.uri}/glass/truth"
    write(catalogue, location.child("catalogue.yaml"))
    assert "Duck [1]/front.mp4" in bytes(obstore.get(location.obstore(), "catalogue.yaml").bytes()).decode()
    assert load(location.child("catalogue.yaml")) == catalogue
    with open_footage(duck.frames) as video, open_footage(glass.frames) as images:
        assert len(list(video.frames())) == 4
        assert len(list(images.frames())) == 12 and images.names[:2] == ("img_1.png", "img_2.png")
        assert "img_1 (1).png of img_1.png" in images.warnings[0]


def test_a_folder_of_images_in_a_bucket_may_be_named_by_a_date(location: Location, tmp_path: Path) -> None:
    write_images(tmp_path / "2024.05.12", FRAMES[:3])
    upload(tmp_path, location)
    with open_footage(f"{location.uri}/2024.05.12") as footage:
        assert len(list(footage.frames())) == 3


def test_a_catalogue_in_a_bucket_keeps_to_it(location: Location) -> None:
    text = "schema: 1\nname: x\nobjects:\n- id: a\n  captures:\n  - {id: b, frames: ../../../../../etc/video.mp4}\n"
    obstore.put(location.obstore(), "catalogue.yaml", text.encode())
    frames = load(location.child("catalogue.yaml")).objects[0].captures[0].frames
    with pytest.raises(GlintError):
        open_footage(frames)
    with pytest.raises(InputError, match="does not exist"):
        load(location.child("other.yaml"))


def test_wrong_credentials_are_reported_without_being_shown(
    location: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = "d3JvbmdzZWNyZXR3cm9uZ3NlY3JldA=="
    for name in ("AWS_SECRET_ACCESS_KEY", "AZURE_STORAGE_ACCOUNT_KEY"):
        monkeypatch.setenv(name, wrong)
    for attempt in (check_conditional_writes, lambda location: ObjectRepository.open(location, "duck"), object_ids):
        with pytest.raises(StoreError) as error:
            attempt(location)
        assert "credentials" in error.value.remedy
        assert wrong not in str(error.value) and wrong not in repr(error.value.__cause__)


def test_a_missing_bucket_is_reported(location: Location) -> None:
    with pytest.raises(StoreError, match="nowhere"):
        check_conditional_writes(Location.parse(f"{location.scheme}://nowhere/x"))


def test_a_server_that_is_down_is_reported(location: Location, monkeypatch: pytest.MonkeyPatch) -> None:
    unused = f"http://127.0.0.1:{free_port()}"
    monkeypatch.setenv("AWS_ENDPOINT_URL", unused)
    monkeypatch.setenv("AZURE_STORAGE_ENDPOINT", f"{unused}/glinttest")
    with pytest.raises(StoreError) as error:
        object_ids(location)
    assert "server is up" in error.value.remedy


def test_what_was_acknowledged_survives_the_death_of_the_server(tmp_path_factory: pytest.TempPathFactory, s3: Gateway,
    monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    for name, value in s3.environment.items():
        monkeypatch.setenv(name, value)
    location = Location.parse(f"s3://store/{uuid4().hex}")
    repository = ObjectRepository.open(location, "duck")
    arrays = save_capture(repository, "front", "1")
    repository.publish(["front"], {})
    s3.kill()
    s3.start()
    again = ObjectRepository.open(location, "duck", create=False)
    np.testing.assert_array_equal(again.load("front", "depth", "v1").read("depth"), arrays["depth"]["depth"])
    save_capture(again, "front", "2", seed=5)
    assert again.publish(["front"], {}).name == "v2"


def test_a_prefix_without_a_store_is_no_store(location: Location) -> None:
    with pytest.raises(StoreError, match="there is no store"):
        check_store(location)
    save_capture(ObjectRepository.open(location, "cup"), "front", "key")
    check_store(location)
