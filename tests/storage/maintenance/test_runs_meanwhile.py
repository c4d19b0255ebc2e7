"""Maintenance of stores in which runs begin at any time."""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path
from threading import Barrier, Event
from typing import Any
from uuid import uuid4

import numpy as np
import pytest

from glint.storage.catalogue.models import Capture
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.edits.overlay import edited_entries
from glint.storage.frames.eviction import cached_frames, remove_frames
from glint.storage.kept_values import keep, read_kept
from glint.storage.locations.location import Location
from glint.storage.locking.locks import mutation_lock, run_lock
from glint.storage.locking.owner import ObjectBusy
from glint.storage.maintenance import maintain as maintenance
from glint.storage.maintenance.maintain import maintain
from glint.storage.versions.repository import ObjectRepository
from tests.storage.maintenance.stored_object import NOW, frames, mesh, part, save, versions


def test_data_of_an_object_whose_run_began_meanwhile_are_left_alone(tmp_path: Path) -> None:
    location = Location.parse(tmp_path)
    versions(location, 2)
    save(location, mesh(0), "key", "bowl")
    frames(location, "a" * 64, 1000, timedelta(days=3))
    repository = ObjectRepository.open(location, "glass")
    repository.save("front", "frames", "key", {}, {"cache": "a" * 64, "counts": {}, "warnings": []})
    with ThreadPoolExecutor(1) as pool, ExitStack() as first:
        first.enter_context(mutation_lock(location, "bowl"))
        cleaning = pool.submit(maintain, location, age=NOW, keep=1, frames_budget=0)
        time.sleep(0.5)
        with run_lock(location, "glass", "night"):
            first.close()
            done = cleaning.result()
    assert repository.version_names() == ["v1", "v2"] and "being run" in part(done, "glass").note
    assert (tmp_path / "frames" / ("a" * 64) / "zarr.json").exists()


def test_a_run_that_begins_during_the_cleaning_keeps_its_edited_inputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    location = Location.parse(tmp_path)
    versions(location, 1)
    Edits.open(location, "glass").save("front", Changes(mask=np.ones((80, 90), bool)), "Ann", 0)
    repository, masks = ObjectRepository.open(location, "glass"), list[Path]()

    def begin_run() -> None:
        with run_lock(location, "glass", "night"):
            (entry,) = edited_entries(repository, [Capture(id="front", frames="/a.mp4")])
            masks.append(Path(str(entry.capture.mask)))

    def begin_run_and(method: Callable[..., Any]) -> Callable[..., Any]:
        def run_first(*arguments: Any) -> Any:
            begin_run()
            return method(*arguments)

        return run_first

    def refuse_run_and(function: Callable[..., Any]) -> Callable[..., Any]:
        def run_first(*arguments: Any, dry_run: bool) -> Any:
            if not dry_run:
                with pytest.raises(ObjectBusy, match="run glint maintain"):
                    begin_run()
            return function(*arguments, dry_run)

        return run_first

    begin_run()
    os.utime(masks[0], (0, 0))
    monkeypatch.setattr(ObjectRepository, "garbage_collect", begin_run_and(ObjectRepository.garbage_collect))
    monkeypatch.setattr(ObjectRepository, "prune", begin_run_and(ObjectRepository.prune))
    monkeypatch.setattr(maintenance, "remove_old_files", refuse_run_and(maintenance.remove_old_files))
    assert part(maintain(location, age=timedelta(days=1), keep=1), "glass").objects > 0
    assert len(masks) == 3 and masks[0].exists()


class FolderAsObjectStore(Location):
    """A folder that is used as an object store is: without locks."""

    local = None

    def child(self, *parts: str) -> "FolderAsObjectStore":
        return FolderAsObjectStore(self.scheme, self.container, super().child(*parts).path)


def test_in_an_object_store_nothing_younger_than_an_hour_is_removed(tmp_path: Path) -> None:
    location = FolderAsObjectStore("file", "", str(tmp_path))
    for key in ("first", "second"):
        save(location, mesh(0), key)
    keep(location, "glass", "0a", [1])
    assert part(maintain(location, age=NOW, keep=1), "glass").objects == 0
    assert read_kept(location, "glass", "0a") == [1]
    for path in tmp_path.rglob("*"):
        os.utime(path, (time.time() - 4000, time.time() - 4000))
    assert part(maintain(location, age=NOW, keep=1), "glass").objects > 0
    assert read_kept(location, "glass", "0a") is None


def test_frames_are_listed_while_their_writer_renames_its_files(tmp_path: Path) -> None:
    location, digest = Location.parse(tmp_path), "a" * 64
    frames(location, digest, 1000, timedelta(days=3))
    folder, ended = tmp_path / "frames" / digest, Event()

    def write() -> None:
        # As zarr does, which puts a file beside each that it replaces.
        while not ended.is_set():
            draft = folder / f"zarr.{uuid4().hex}.partial"
            draft.write_bytes(b"{}")
            draft.replace(folder / "zarr.json")

    with ThreadPoolExecutor(2) as pool:
        writers = [pool.submit(write) for _ in range(2)]
        try:
            for _ in range(1000):
                (cached,) = cached_frames(location)
                assert cached.digest == digest and cached.bytes >= 998
        finally:
            ended.set()
    assert [writer.result() for writer in writers] == [None, None]


def test_two_cleanings_may_remove_the_same_frames(tmp_path: Path) -> None:
    location, digest = Location.parse(tmp_path), "a" * 64
    for _ in range(20):
        frames(location, digest, 1000, timedelta(days=3))
        for number in range(200):
            (tmp_path / "frames" / digest / "object" / "c" / str(number)).write_bytes(b"x")
        both = Barrier(2)

        def remove(both: Barrier = both) -> None:
            chosen = cached_frames(location)
            both.wait()
            remove_frames(location, chosen)

        with ThreadPoolExecutor(2) as pool:
            assert [removal.result() for removal in [pool.submit(remove) for _ in range(2)]] == [None, None]
        assert cached_frames(location) == [] and not (tmp_path / "frames" / digest).exists()
