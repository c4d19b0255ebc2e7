import hashlib
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from glint.storage.blobs import store as blobs
from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from tests.storage.stores import local_place


@pytest.fixture
def place(tmp_path: Path) -> Location:
    return local_place(tmp_path / "store")


def test_a_blob_is_named_by_its_content(place: Location) -> None:
    reference = blobs.put(place, b"mesh", "model/ply")
    digest = hashlib.sha256(b"mesh").hexdigest()
    assert reference == blobs.BlobReference(f"blobs/sha256/{digest[:2]}/{digest}", digest, 4, "model/ply")
    assert blobs.get(place, reference) == b"mesh" and blobs.exists(place, reference)


def test_the_same_blob_again_is_harmless(place: Location) -> None:
    assert blobs.put(place, b"mesh", "model/ply") == blobs.put(place, b"mesh", "model/ply")
    assert len([path for path in (place.local / "blobs" / "sha256").rglob("*") if path.is_file()]) == 1
    assert blobs.get(place, blobs.put(place, b"", "text/plain")) == b""


@pytest.mark.parametrize("stored", [b"moss", b"mes", b"", b"meshes"])
def test_wrong_bytes_are_refused(place: Location, stored: bytes) -> None:
    reference = blobs.put(place, b"mesh", "model/ply")
    (place.local / reference.key).write_bytes(stored)
    with pytest.raises(StoreError, match="does not hold the bytes"):
        blobs.get(place, reference)


def test_a_cut_off_blob_is_mended_by_storing_it_again(place: Location) -> None:
    reference = blobs.put(place, b"mesh", "model/ply")
    (place.local / reference.key).write_bytes(b"me")
    assert not blobs.exists(place, reference)
    blobs.put(place, b"mesh", "model/ply")
    assert blobs.get(place, reference) == b"mesh"


def test_a_missing_blob_says_so(place: Location) -> None:
    reference = blobs.put(place, b"mesh", "model/ply")
    (place.local / reference.key).unlink()
    assert not blobs.exists(place, reference)
    with pytest.raises(StoreError, match="is missing"):
        blobs.get(place, reference)


@pytest.mark.parametrize("change", [{"key": "../../etc/passwd"}, {"key": "blobs/sha256/aa/bb"}, {"sha256": "../x"}])
def test_a_hostile_reference_reads_nothing(place: Location, change: dict[str, str]) -> None:
    reference = replace(blobs.put(place, b"mesh", "model/ply"), **change)
    for use in (blobs.get, blobs.exists):
        with pytest.raises(StoreError, match="does not follow from its digest"):
            use(place, reference)


def test_readers_see_a_blob_whole_or_not_at_all(place: Location) -> None:
    data = bytes(range(256)) * 40_000
    path = place.local / blobs.put(place, data, "x").key
    stop, seen = threading.Event(), set()

    def watch() -> None:
        while not stop.is_set():
            if path.exists():
                try:
                    seen.add(path.stat().st_size)
                except FileNotFoundError:
                    continue

    watcher = threading.Thread(target=watch)
    watcher.start()
    for _ in range(5):
        path.unlink()
        writers = [threading.Thread(target=blobs.put, args=(place, data, "x")) for _ in range(3)]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join()
    stop.set()
    watcher.join()
    assert seen == {len(data)}
    assert [other.name for other in path.parent.iterdir()] == [path.name]


def test_an_unwritable_store_is_a_store_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError):
        blobs.put(local_place(tmp_path / "file" / "store"), b"mesh", "model/ply")
