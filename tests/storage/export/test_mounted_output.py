"""Exports to a folder that is a disk of its own, such as a mounted volume, and by way of a link to another disk."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from glint.storage.export.formats import export_as
from glint.storage.export.replaced_folder import MARKER, replaced_folder, temporary_folder_for
from glint.storage.locations.location import Location


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A mounted disk."""
    place = tmp_path / "disk"
    place.mkdir()
    if os.geteuid() or subprocess.run(["mount", "-t", "tmpfs", "none", place], check=False).returncode:
        pytest.skip("mounting a disk needs root")
    yield place
    subprocess.run(["umount", place], check=True)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_an_export_fills_a_disk_and_replaces_an_earlier_one(location: Location, disk: Path) -> None:
    first = export_as("files", location, "duck", disk)
    before = names(disk)
    assert "front" in before and not any(entry.startswith(".") for entry in before)
    (disk / "front" / "of yesterday").touch()
    assert export_as("files", location, "duck", disk).files == first.files
    assert names(disk) == before and not (disk / "front" / "of yesterday").exists()


def test_a_folder_that_is_replaced_whole_may_be_a_disk(disk: Path) -> None:
    for name in ("first", "second"):
        with replaced_folder(disk, {"object": "duck", "format": "pcd"}) as content:
            (content / name).touch()
        assert names(disk) == {name, MARKER}


def test_a_link_to_a_folder_of_another_disk_is_followed(location: Location, disk: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    (disk / "out").mkdir()
    link.symlink_to(disk / "out")
    for name in ("first", "second"):
        with replaced_folder(link, {"object": "duck", "format": "pcd"}) as content:
            (content / name).touch()
        assert link.is_symlink() and names(link) == {name, MARKER} and names(disk) == {"out"}
    for path in link.iterdir():
        path.unlink()
    export_as("files", location, "duck", link)
    assert "front" in names(disk / "out") and names(disk) == {"out"}


def test_an_export_is_prepared_in_a_folder_that_exists(tmp_path: Path) -> None:
    """The folder that contains it may belong to somebody else."""
    with temporary_folder_for(tmp_path) as content:
        assert content.is_relative_to(tmp_path)
    assert not names(tmp_path)
