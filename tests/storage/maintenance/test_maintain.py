"""Maintenance on real stores: removed and kept data, and the report of a dry run."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.models import Capture
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.edits.overlay import edited_entries
from glint.storage.errors import StoreError
from glint.storage.frames.eviction import (
    CachedFrames,
    cached_frames,
    discard_frames,
    mark_used,
    over_budget,
    remove_frames,
)
from glint.storage.kept_values import keep, read_kept
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_lock
from glint.storage.maintenance.disk_space import DiskSpace
from glint.storage.maintenance.maintain import format_size, maintain, parse_size
from glint.storage.versions.garbage import BRANCH_PREFIX, delete_stale_branches, new_branch_name
from glint.storage.versions.repository import ObjectRepository
from tests.storage.maintenance.stored_object import NOW, STAGES, frames, mesh, part, save, versions


def chunks(folder: Path) -> int:
    return len(list((folder / "objects" / "glass" / "repo" / "chunks").iterdir()))


def test_nothing_is_left_of_frames_that_are_discarded(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    frames(location, "a" * 64, 1000, timedelta(days=3))
    mark_used(location, "a" * 64)
    discard_frames(location, "a" * 64)
    assert list((tmp_path / "frames").iterdir()) == []


def test_a_removal_that_is_interrupted_leaves_no_valid_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **options: object) -> None:
        raise OSError(5, "Input/output error")

    location = Location.parse(tmp_path)
    frames(location, "a" * 64, 1000, timedelta(days=3))
    monkeypatch.setattr("shutil.rmtree", fail)
    with pytest.raises(StoreError, match="removing frames"):
        remove_frames(location, cached_frames(location))
    assert not (tmp_path / "frames" / ("a" * 64) / "zarr.json").exists()


def test_folders_of_other_names_are_no_frames(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    for name in ("a" * 64, "b" * 65, "c" * 63, "D" * 64):
        frames(location, name, 1000, timedelta(days=3))
    assert [entry.digest for entry in cached_frames(location)] == ["a" * 64]


def test_data_of_a_version_stay(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 3)
    save(location, mesh(9), "unpublished")
    save(location, mesh(2), "key-2")
    assert chunks(tmp_path) == 5
    maintain(location, age=NOW, dry_run=True)
    assert chunks(tmp_path) == 5
    done = maintain(location, age=NOW)
    assert part(done, "glass").bytes > 0 and chunks(tmp_path) == 4
    repository = ObjectRepository.open(location, "glass", create=False)
    for number in range(3):
        result = repository.load("front", "surface", f"v{number + 1}")
        assert result.read_file("surface.ply") == mesh(number) and result.read("depth").shape == (2, 3)


def test_kept_values_go_when_they_are_old(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    save(location, mesh(0), "key")
    keep(location, "glass", "0a", [1])
    maintain(location, age=timedelta(hours=1), keep=1)
    assert read_kept(location, "glass", "0a") == [1]
    maintain(location, age=NOW, keep=1)
    assert read_kept(location, "glass", "0a") is None


def test_edits_stay_and_the_files_made_of_them_go(tmp_path: Path) -> None:
    location, edits = Location.parse(tmp_path), Edits.open(Location.parse(tmp_path), "glass")
    versions(location, 1)
    masks = [np.random.default_rng(number).random((80, 90)) < 0.5 for number in range(3)]
    for number, mask in enumerate(masks):
        edits.save("front", Changes(mask=mask), "Ann", number)
    (entry,) = edited_entries(ObjectRepository.open(location, "glass"), [Capture(id="front", frames="/a.mp4")])
    assert entry.capture.mask is not None and Path(entry.capture.mask).exists()
    assert part(maintain(location, age=timedelta(hours=1), keep=1), "glass").objects == 0
    assert Path(entry.capture.mask).exists()
    maintain(location, age=NOW, keep=1)
    assert not Path(entry.capture.mask).exists()
    for number, mask in enumerate(masks):
        np.testing.assert_array_equal(Edits.open(location, "glass").current("front", number + 1).mask, mask)


def test_only_old_data_are_removed(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 1)
    save(location, mesh(1), "key-1")
    save(location, mesh(2), "key-2")
    assert part(maintain(location, age=timedelta(hours=1)), "glass").objects == 0
    assert chunks(tmp_path) == 3


def test_versions_are_pruned_only_on_request(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 4)
    dry = maintain(location, age=NOW, dry_run=True, keep=2)
    assert part(dry, "glass").note == "would remove v1, v2"
    repository = ObjectRepository.open(location, "glass", create=False)
    assert repository.version_names() == ["v1", "v2", "v3", "v4"]
    done = maintain(location, age=NOW, keep=2)
    assert part(done, "glass").note == "removed v1, v2" and part(done, "glass").bytes > 0
    assert repository.version_names() == ["v3", "v4"]
    assert chunks(tmp_path) == 2
    assert repository.load("front", "surface", "v3").read("depth").shape == (2, 3)
    save(location, mesh(4), "key-4")
    assert ObjectRepository.open(location, "glass").publish(["front"], {}, STAGES).name == "v5"


def test_data_of_a_running_object_are_left_alone(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 3)
    frames(location, "a" * 64, 1000, timedelta(days=3))
    repository = ObjectRepository.open(location, "glass")
    repository.save("front", "frames", "key", {}, {"cache": "a" * 64, "counts": {}, "warnings": []})
    with run_lock(location, "glass", "night"):
        done = maintain(location, age=NOW, keep=1, frames_budget=0)
    assert repository.version_names() == ["v1", "v2", "v3"] and chunks(tmp_path) == 3
    assert (tmp_path / "frames" / ("a" * 64) / "zarr.json").exists()
    assert "being run" in part(done, "glass").note and "in use" in part(done, "frames").note
    assert part(maintain(location, age=NOW, frames_budget=0), "frames").objects == 1
    assert not list((tmp_path / "frames").iterdir())


def test_a_dry_run_writes_nothing(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 3)
    for lock in (tmp_path / "objects" / "glass").glob("*.lock"):
        lock.unlink()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    cleaned = maintain(location, age=NOW, dry_run=True, keep=1, frames_budget=0)
    assert "would remove v1, v2" in part(cleaned, "glass").note
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_the_least_recently_used_frames_are_removed_first(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    for digest, days in (("a", 3), ("b", 9), ("c", 5), ("d", 1)):
        frames(location, digest * 64, 1000, timedelta(days=days))
    mark_used(location, "b" * 64)
    assert [entry.digest[0] for entry in cached_frames(location)] == ["c", "a", "d", "b"]
    dry = maintain(location, age=NOW, dry_run=True, frames_budget=2500)
    assert part(dry, "frames").objects == 2 and len(cached_frames(location)) == 4
    maintain(location, age=NOW, frames_budget=2500)
    assert [entry.digest[0] for entry in cached_frames(location)] == ["d", "b"]


def test_files_behind_links_in_a_store_are_not_removed(tmp_path: Path) -> None:
    location, outside = Location.parse(tmp_path / "store"), tmp_path / "outside"
    frames(location, "a" * 64, 1000, timedelta(days=3))
    outside.mkdir()
    (outside / "precious").write_bytes(b"not ours")
    (outside / "zarr.json").write_bytes(b"nor this")
    os.utime(outside / "precious", (0, 0))
    os.utime(outside / "zarr.json", (0, 0))
    (tmp_path / "store" / "frames" / ("b" * 64)).symlink_to(outside)
    (tmp_path / "store" / "frames" / ("a" * 64) / "object" / "link").symlink_to(outside)
    done = maintain(location, age=NOW, frames_budget=0)
    assert part(done, "frames").objects == 1
    assert sorted(entry.name for entry in outside.iterdir()) == ["precious", "zarr.json"]


def test_frames_that_were_used_just_now_stay_whatever_the_budget() -> None:
    now = datetime.now(UTC)
    old, fresh = CachedFrames("a", 10, now - timedelta(days=1)), CachedFrames("b", 10, now)
    assert over_budget([old, fresh], 0, (), now) == [old]
    assert over_budget([old, fresh], 0, {"a"}, now) == []
    assert over_budget([old, fresh], 20, (), now) == []


def save_broken(location: Location, folder: Path) -> None:
    """Save the object `broken` in the store of a folder, and damage it."""
    save(location, b"of the broken one", "key", "broken")
    for snapshot in (folder / "objects" / "broken" / "repo" / "snapshots").iterdir():
        snapshot.write_bytes(b"damaged")


def test_an_object_that_cannot_be_read_does_not_stop_the_rest(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 1)
    save_broken(location, tmp_path)
    done = maintain(location, age=NOW)
    assert part(done, "broken").failed and not part(done, "glass").failed


def test_frames_stay_while_it_is_unknown_which_of_them_a_run_uses(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 1)
    save_broken(location, tmp_path)
    frames(location, "a" * 64, 1000, timedelta(days=3))
    with run_lock(location, "broken", "night"):
        done = maintain(location, age=NOW, frames_budget=0)
    assert (tmp_path / "frames" / ("a" * 64) / "zarr.json").exists()
    assert part(done, "frames").note.startswith("left alone") and not done.failed


def test_an_object_in_its_first_run_does_not_stop_the_rest(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 1)
    save(location, mesh(1), "unpublished")
    with run_lock(location, "new", "night"):
        done = maintain(location, age=NOW, frames_budget=0)
    assert part(done, "glass").objects > 0 and part(done, "frames").note.startswith("left alone") and not done.failed


@pytest.mark.parametrize(("text", "size"), [("500MB", 5 * 10**8), ("1.5 tb", 15 * 10**11), ("0", 0)])
def test_sizes_are_parsed(text: str, size: int) -> None:
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["20G", "200", "x", "-1GB", "", "1e30GB"])
def test_invalid_sizes(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a size|could not convert"):
        parse_size(text)


def test_the_disk_is_called_low_before_it_is_full() -> None:
    assert DiskSpace(10, 100, 2).warning(5) == ""
    assert "room for about 5" in DiskSpace(10, 100, 2).warning(6)
    assert "are free" in DiskSpace(9, 100, None).warning(0)
    assert DiskSpace(50, 100, None).warning(1000) == ""


@pytest.mark.parametrize(("size", "text"), [(0, "0.0 MB"), (1_500_000_000, "1.5 GB"), (2 * 10**12, "2.0 TB")])
def test_sizes_are_formatted_as_they_are_parsed(size: int, text: str) -> None:
    assert format_size(size) == text and parse_size(text) == size


def test_a_branch_is_as_old_as_its_publisher_not_as_its_snapshot(tmp_path: Path) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path), "branches").index
    snapshot = repository.lookup_branch("main")
    young, old = new_branch_name(), f"{BRANCH_PREFIX}1000-abc"
    for name in (young, old):
        repository.create_branch(name, snapshot)
    delete_stale_branches(repository, datetime.now(UTC) - timedelta(minutes=1))
    assert young in repository.list_branches() and old not in repository.list_branches()
