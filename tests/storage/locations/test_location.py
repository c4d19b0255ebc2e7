"""Addresses: paths, s3:// and az://; nothing leads out of its folder, no credentials in an address."""

import pickle
from pathlib import Path

import pytest

from glint.storage.locations.location import Location, LocationError


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("/data/store", ("file", "", "/data/store")),
        ("/data/a/../store/", ("file", "", "/data/store")),
        ("/", ("file", "", "/")),
        ("file:///data/store", ("file", "", "/data/store")),
        ("s3://bucket", ("s3", "bucket", "")),
        ("s3://bucket/", ("s3", "bucket", "")),
        ("S3://bucket/a//b/", ("s3", "bucket", "a/b")),
        ("az://container/a b/é.mp4", ("az", "container", "a b/é.mp4")),
        ("s3://bucket/img_*.png", ("s3", "bucket", "img_*.png")),
        ("/data/s3:x", ("file", "", "/data/s3:x")),
    ],
)
def test_addresses(address: str, place: tuple[str, str, str]) -> None:
    location = Location.parse(address)
    assert (location.scheme, location.container, location.path) == place
    assert Location.parse(location.uri) == location
    assert pickle.loads(pickle.dumps(location)) == location


def test_relative_paths_count_from_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Location.parse("a/b.mp4", tmp_path).local == tmp_path / "a/b.mp4"
    assert Location.parse("../b.mp4", tmp_path).local == tmp_path.parent / "b.mp4"
    assert Location.parse(Path("b.mp4"), tmp_path).local == tmp_path / "b.mp4"
    assert Location.parse("/b.mp4", tmp_path).local == Path("/b.mp4")
    assert Location.parse("s3://bucket/b.mp4", tmp_path).uri == "s3://bucket/b.mp4"
    monkeypatch.chdir(tmp_path)
    assert Location.parse("b.mp4").local == tmp_path / "b.mp4"


def test_the_home_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", "/home/somebody")
    assert Location.parse("~/store").path == "/home/somebody/store"
    assert Location.parse("~nobody-of-this-name/store", tmp_path).local == tmp_path / "~nobody-of-this-name/store"


@pytest.mark.parametrize(
    "address",
    [
        "",
        "  ",
        "a\0b",
        "s3://",
        "s3:///key",
        "s3:/bucket/key",
        "S3:bucket",
        "az:/container",
        "s3://b",
        "s3://-bucket/key",
        "s3://buck et/key",
        "s3://bucket\n/key",
        "s3://bucket/../other",
        "s3://bucket/a/./b",
        "s3://bucket/a/..",
        "gs://bucket/key",
        "https://host/bucket/key",
        "javascript://bucket/key",
    ],
)
def test_addresses_that_are_refused(address: str) -> None:
    with pytest.raises(LocationError) as caught:
        Location.parse(address)
    assert caught.value.remedy


@pytest.mark.parametrize("address", ["s3://key:secret@bucket/a", "s3://secret@bucket/a", "az://host:1000/a"])
def test_credentials_in_an_address_are_refused_and_not_repeated(address: str) -> None:
    with pytest.raises(LocationError) as caught:
        Location.parse(address)
    assert "secret" not in str(caught.value)
    assert "environment" in caught.value.remedy


@pytest.mark.parametrize("address", ["/data/store", "/", "s3://bucket/store", "s3://bucket", "az://container"])
def test_children_and_parents(address: str) -> None:
    location = Location.parse(address)
    child = location.child("frames", "a.b")
    assert child.uri == location.uri.rstrip("/") + "/frames/a.b"
    assert child.name == "a.b"
    assert child.parent.parent == location
    assert Location.parse(child.uri) == child


@pytest.mark.parametrize("part", ["", ".", "..", "a/b", "/a", "a\\b", "a\0"])
@pytest.mark.parametrize("address", ["/data/store", "s3://bucket/store"])
def test_no_child_lies_elsewhere(address: str, part: str) -> None:
    with pytest.raises(LocationError):
        Location.parse(address).child("a", part)


def test_only_paths_are_local() -> None:
    assert Location.parse("/data").local == Path("/data")
    assert Location.parse("s3://bucket/data").local is None


def test_a_local_folder_is_made_when_it_is_written_to(tmp_path: Path) -> None:
    location = Location.parse(tmp_path / "a" / "store")
    location.zarr_store(read_only=True)
    assert not (tmp_path / "a").exists()
    location.obstore().put("key", b"value")
    assert (tmp_path / "a/store/key").read_bytes() == b"value"
