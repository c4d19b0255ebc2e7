"""Digests follow the content, and files that did not change are not read again."""

import hashlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import glint.storage.inputs.digests
from glint.storage.errors import InputError, StoreError
from glint.storage.inputs.digests import content_digest
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of

PAST = time.time() - 1000


@pytest.fixture
def store(tmp_path: Path) -> Location:
    """A store beside the inputs."""
    return Location.parse(tmp_path / "store")


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were read, and a clock by which all files are old."""
    names: list[str] = []
    original = glint.storage.inputs.digests._sha256

    def noted(file: Location, count: Callable[[int], None]) -> str:
        names.append(file.name)
        return original(file, count)

    monkeypatch.setattr(glint.storage.inputs.digests, "_sha256", noted)
    monkeypatch.setattr(glint.storage.inputs.digests, "_RECENT_NS", 0)
    return names


def _file(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    os.utime(path, (PAST, PAST))
    return path


def test_a_value_is_known_by_its_content() -> None:
    value = {"a": [1, 2.5, None, True, "é\ud800"], "b": {"c": "d"}}
    assert digest_of(value) == digest_of({"b": {"c": "d"}, "a": [1, 2.5, None, True, "é\ud800"]})
    assert len(digest_of(value)) == 64
    different: list[Any] = [1, 1.5, "1", True, None, [1], [[1]], {"1": 1}, {}, [], "", [1, 2], [2, 1], {"1": [1]}]
    assert len({digest_of(value) for value in different}) == len(different)


def test_a_value_keeps_its_digest_for_ever() -> None:
    """Caches of earlier runs are found by it."""
    assert digest_of({"b": [1, "é"], "a": None}) == hashlib.sha256('{"a":null,"b":[1,"é"]}'.encode()).hexdigest()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), {"a": [-float("inf")]}])
def test_what_is_not_finite_has_no_digest(value: Any) -> None:
    with pytest.raises(ValueError, match="JSON"):
        digest_of(value)


@pytest.mark.parametrize("value", [{1, 2}, b"a", Path("a"), object()])
def test_what_is_no_json_has_no_digest(value: Any) -> None:
    with pytest.raises(TypeError):
        digest_of(value)


def test_a_file_is_known_by_its_bytes(tmp_path: Path, store: Location) -> None:
    data = bytes(range(256)) * 40_000
    path = _file(tmp_path / "a.mp4", data)
    assert content_digest(path, store) == hashlib.sha256(data).hexdigest()
    assert content_digest(_file(tmp_path / "other/b.mp4", data), store) == content_digest(path, store)
    assert content_digest(_file(tmp_path / "c.mp4", b""), store) == hashlib.sha256(b"").hexdigest()


def test_a_file_is_read_once(tmp_path: Path, store: Location, read: list[str]) -> None:
    path = _file(tmp_path / "a.mp4", b"one")
    digest = content_digest(path, store)
    assert content_digest(path, store) == content_digest(Location.parse(path), store) == digest
    assert read == ["a.mp4"]
    assert content_digest(path, store, rehash=True) == digest
    assert content_digest(path, Location.parse(tmp_path / "other")) == digest
    assert read == ["a.mp4"] * 3


def test_a_change_is_detected(tmp_path: Path, store: Location, read: list[str]) -> None:
    path = _file(tmp_path / "a.mp4", b"one")
    before = content_digest(path, store)
    path.write_bytes(b"three")
    assert content_digest(path, store) == hashlib.sha256(b"three").hexdigest() != before


def test_a_change_that_keeps_size_and_time_is_detected(tmp_path: Path, store: Location, read: list[str]) -> None:
    path = _file(tmp_path / "a.mp4", b"one")
    content_digest(path, store)
    time.sleep(0.02)
    _file(path, b"two")
    assert content_digest(path, store) == hashlib.sha256(b"two").hexdigest()
    time.sleep(0.02)
    _file(tmp_path / "b.mp4", b"six").replace(path)
    assert content_digest(path, store) == hashlib.sha256(b"six").hexdigest()


def test_a_file_of_this_moment_is_not_remembered(
    tmp_path: Path, store: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glint.storage.inputs.digests, "_RECENT_NS", 60_000_000_000)
    path = tmp_path / "a.mp4"
    for data in (b"one", b"two", b"six"):
        path.write_bytes(data)
        assert content_digest(path, store) == hashlib.sha256(data).hexdigest()
    assert not (tmp_path / "store/digests").exists() or not list((tmp_path / "store/digests").iterdir())


def test_a_file_that_changes_while_it_is_read_is_reported(
    tmp_path: Path, store: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _file(tmp_path / "a.mp4", b"one")

    def grow(file: Location, count: Callable[[int], None]) -> str:
        path.write_bytes(b"longer")
        return "0" * 64

    monkeypatch.setattr(glint.storage.inputs.digests, "_sha256", grow)
    with pytest.raises(InputError, match="changed while it was read"):
        content_digest(path, store)


def test_a_folder_is_known_by_names_and_bytes(tmp_path: Path, store: Location, read: list[str]) -> None:
    folder = tmp_path / "images"
    for name, data in (("img_2.png", b"b"), ("img_10.png", b"c"), ("img_1.png", b"a")):
        _file(folder / name, data)
    digest = content_digest(folder, store)
    assert content_digest(folder / "img_*.png", store) == digest
    _file(folder / "notes.txt", b"no image")
    assert content_digest(folder, store) == digest
    assert sorted(read) == ["img_1.png", "img_10.png", "img_2.png"]
    (folder / "img_2.png").rename(folder / "img_3.png")
    renamed = content_digest(folder, store)
    (folder / "img_3.png").write_bytes(b"d")
    changed = content_digest(folder, store)
    (folder / "img_3.png").unlink()
    fewer = content_digest(folder, store)
    assert len({digest, renamed, changed, fewer}) == 4


def test_the_order_of_frames_in_several_folders_counts(tmp_path: Path, store: Location, read: list[str]) -> None:
    shots = tmp_path / "captures/shots"
    for number in (1, 2, 10):
        _file(shots / f"{number}/img.png", bytes([number]))
    digest = content_digest(shots / "*/img.png", store)
    moved = (tmp_path / "captures").rename(tmp_path / "moved") / "shots"
    assert content_digest(moved / "*/img.png", store) == digest
    (moved / "1").rename(moved / "3")
    assert content_digest(moved / "*/img.png", store) != digest


def test_the_digest_of_a_folder_is_that_of_sorted_names(tmp_path: Path, store: Location) -> None:
    """Results of earlier runs are found by it."""
    for name in ("img_2.png", "img_10.png"):
        _file(tmp_path / name, name.encode())
    digests = [[name, hashlib.sha256(name.encode()).hexdigest()] for name in ("img_10.png", "img_2.png")]
    expected = digest_of(digests)
    assert content_digest(tmp_path, store) == content_digest(tmp_path / "img_*.png", store) == expected


def test_copies_among_images_are_told_from_frames(tmp_path: Path, store: Location) -> None:
    """Frames that were stored with the copies, and named by this digest, are not taken for those without."""
    for name in ("img_2.png", "img_10.png"):
        _file(tmp_path / name, b"a")
    digest = hashlib.sha256(b"a").hexdigest()
    assert content_digest(tmp_path, store) != digest_of([["img_10.png", digest], ["img_2.png", digest]])


def test_a_folder_of_one_file_is_not_that_file(tmp_path: Path, store: Location, read: list[str]) -> None:
    path = _file(tmp_path / "images/img_1.png", b"a")
    assert content_digest(path, store) == hashlib.sha256(b"a").hexdigest()
    assert content_digest(path.parent, store) != content_digest(path, store)
    assert content_digest(path, store) == hashlib.sha256(b"a").hexdigest()


def test_a_folder_without_images_is_refused(tmp_path: Path, store: Location) -> None:
    _file(tmp_path / "truth/normals.npy", b"a")
    with pytest.raises(InputError, match="no images"):
        content_digest(tmp_path / "truth", store)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"stamps": 1, "digest": 2}', "\xff"])
def test_a_damaged_memory_is_no_memory(tmp_path: Path, store: Location, read: list[str], text: str) -> None:
    path = _file(tmp_path / "a.mp4", b"one")
    digest = content_digest(path, store)
    (record,) = (tmp_path / "store/digests").iterdir()
    whole = record.read_bytes()
    record.write_text(text, encoding="latin-1")
    assert content_digest(path, store) == digest
    assert record.read_bytes() == whole


@pytest.mark.parametrize("name", ["none.mp4", "none/img_*.png"])
def test_nothing_there(tmp_path: Path, store: Location, name: str) -> None:
    with pytest.raises(InputError, match=r"does not exist|no images"):
        content_digest(tmp_path / name, store)


def test_a_pipe_is_no_input(tmp_path: Path, store: Location) -> None:
    """Reading it would wait for ever."""
    os.mkfifo(tmp_path / "pipe.mp4")
    with pytest.raises(InputError):
        content_digest(tmp_path / "pipe.mp4", store)


def test_a_memory_that_cannot_be_written(tmp_path: Path, read: list[str]) -> None:
    path = _file(tmp_path / "a.mp4", b"one")
    (tmp_path / "store").write_text("a file")
    with pytest.raises(StoreError, match="a file in place of a folder"):
        content_digest(path, Location.parse(tmp_path / "store"))
