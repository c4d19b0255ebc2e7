"""Versioned results of one object: an icechunk repository at STORE/objects/<id>/repo.

Branch `work` takes every stage's result as it finishes; resuming reads from there. A version is a snapshot that has
been checked, tagged v1, v2, ..; branch `main` is the newest one and what readers see by default. A version holds all
its captures' results itself, so any zarr reader opens it by its tag alone.

A rollback is a new version with an old one's content: nothing that was ever published is taken from history. It stands
until a key of the version it replaced changes: publishing the very results that were rolled back from makes no version.
"""

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from random import uniform
from typing import Any

import icechunk

from glint.storage.errors import StoreError
from glint.storage.fsync import flush_tree
from glint.storage.locations.error_translation import store_faults
from glint.storage.locations.location import Location
from glint.storage.locking.locks import mutation_lock
from glint.storage.versions import snapshots
from glint.storage.versions.array_schema import REQUIRED_STAGES, problems
from glint.storage.versions.garbage import Garbage, collect
from glint.storage.versions.snapshots import Version
from glint.storage.versions.stage_results import (
    WHOLE_OBJECT,
    Keys,
    StageResult,
    StoredFile,
    check_layout,
    check_name,
    contents,
    read_stage,
    stage_keys,
    stage_records,
    write_stage,
)

icechunk.set_logs_filter("error")

_ATTEMPTS = 30


class ObjectRepository:
    """Results of one object; safe to use from several processes at once, each with its own instance."""

    def __init__(self, location: Location, object_id: str, repository: icechunk.Repository) -> None:
        self.location, self.object_id, self._repository = location, object_id, repository
        self._place = location.child("objects", object_id, "repo")

    @classmethod
    def open(cls, location: Location, object_id: str, create: bool = True) -> "ObjectRepository":
        """The object's repository, made where it is absent if `create`.

        Raises:
            StoreError: no such object, an id that cannot name one, another version's layout, or the store cannot be
                used.
        """
        place = location.child("objects", check_name(object_id, "object"), "repo")
        with store_faults(place.uri, f"opening object {object_id}"):
            try:
                repository = snapshots.open_repository(place)
                if not create or "work" in repository.list_branches():
                    check_layout(snapshots.session(repository, "work").store, object_id, location.uri)
                    return cls(location, object_id, repository)
            except icechunk.RepositoryNotFoundError:
                if not create:
                    raise StoreError(
                        f"no object {object_id} in {location.uri}", "see `glint status` for what is there"
                    ) from None
            with mutation_lock(location, object_id):
                return cls(location, object_id, snapshots.open_or_create(place))

    def stage_key(self, capture: str, stage: str, ref: str = "work") -> str | None:
        """Key under which the stage was saved last, or None."""
        with self._faults(f"reading {capture}/{stage}"):
            return stage_keys(snapshots.session(self._repository, ref).store, capture).get(stage)

    def records(self, capture: str, ref: str = "work") -> dict[str, tuple[str, dict[str, Any]]]:
        """Key and record of each stage of a capture that has been saved, without its arrays."""
        with self._faults(f"reading {capture}"):
            return stage_records(snapshots.session(self._repository, ref).store, capture)

    def save(
        self,
        capture: str,
        stage: str,
        key: str,
        arrays: Mapping[str, Any],
        record: Mapping[str, Any],
        files: Mapping[str, StoredFile] | None = None,
    ) -> str:
        """Replace the stage's result whole, in one commit on `work`; the snapshot's id.

        Whoever reads meanwhile sees the old result or the new one. Acknowledged only once it is stored.
        """

        def write() -> str:
            session = self._repository.writable_session("work")
            write_stage(session.store, capture, stage, key, arrays, record, files or {})
            metadata = {"capture": capture, "stage": stage, "key": key}
            return str(session.commit(f"{capture}/{stage}", metadata, rebase_with=icechunk.ConflictDetector()))

        return self._mutate(f"saving {capture}/{stage}", write)

    def load(self, capture: str, stage: str, ref: str = "work") -> StageResult:
        """The stage's result on a branch, in a version ("v2") or in a snapshot.

        Raises:
            StoreError: it is not there.
        """
        with self._faults(f"reading {capture}/{stage}"):
            result = read_stage(snapshots.session(self._repository, ref).store, self.object_id, capture, stage)
        if result is None:
            raise StoreError(f"{self.object_id} has no {capture}/{stage} in {ref}", "run the object first")
        return result

    def load_capture(self, capture: str, ref: str = "work") -> dict[str, StageResult]:
        """Return all results of a capture by stage, read in one session, which is faster than one stage at a time."""
        with self._faults(f"reading {capture}"):
            return self._read_capture(snapshots.session(self._repository, ref).store, capture)

    def captures(self, ref: str = "work") -> list[str]:
        """Captures with a result, sorted; WHOLE_OBJECT is none of them."""
        return [name for name in self.contents(ref) if name != WHOLE_OBJECT]

    def contents(self, ref: str = "work") -> Keys:
        """Stage keys by capture and stage, WHOLE_OBJECT included."""
        with self._faults("listing"):
            return contents(snapshots.session(self._repository, ref).store)

    def publish(
        self,
        captures: Sequence[str],
        metadata: Mapping[str, Any],
        stages: Sequence[str] = REQUIRED_STAGES,
        message: str = "",
        retire: Collection[str] = (),
    ) -> Version:
        """Make the named captures' results on `work` a version: tag it and move `main` there.

        Captures that are not named stay as they are in the current version, those of `retire` are left out.
        Nothing new: the current version, with `created` False.

        Raises:
            StoreError: a result is missing or malformed; nothing has changed then.
        """

        def attempt() -> Version:
            current = snapshots.settle(self._repository)
            base = self._repository.lookup_branch("work")
            work = snapshots.session(self._repository, base).store
            keys = {capture: stage_keys(work, capture) for capture in captures}
            old, rejected = (current.stages, current.rejected) if current else ({}, {})
            new = {
                capture: of for capture, of in keys.items() if of != old.get(capture) and of != rejected.get(capture)
            }
            if current and not new and not old.keys() & set(retire):
                return replace(current, created=False)
            for capture in new:
                self._check(work, capture, stages)
            kept = {capture: of for capture, of in old.items() if capture not in new and capture not in retire}
            if not new and not kept:
                raise StoreError(f"{self.object_id} has nothing to publish", "name at least one capture")
            new_version = snapshots.successor(
                current,
                stages=kept | new,
                rejected={capture: of for capture, of in rejected.items() if capture not in new},
                metadata=metadata,
                message=message,
            )
            return snapshots.commit_version(self._repository, self.object_id, base, current, new_version, kept)

        return self._mutate("publishing", attempt)

    def rollback(self, version: str, message: str = "") -> Version:
        """Make a new version with the content of an old one; rolling back to the current one makes none."""

        def attempt() -> Version:
            current, target = snapshots.settle(self._repository), self.version(version)
            if current is None or target.snapshot == current.snapshot:
                return replace(target, created=False)
            rejected = {c: of for c, of in current.stages.items() if of != target.stages.get(c)}
            new_version = snapshots.successor(
                current,
                stages=target.stages,
                rejected=rejected,
                metadata=target.metadata | {"rolled_back_to": target.name, "replaces": current.name},
                message=message or f"roll back from {current.name} to {target.name}",
            )
            return snapshots.commit_version(self._repository, self.object_id, target.snapshot, current, new_version, {})

        return self._mutate("rolling back", attempt)

    def history(self) -> list[Version]:
        """All versions, oldest first."""
        with self._faults("reading the history"):
            return [
                snapshots.read_version(self._repository, name) for name in snapshots.version_names(self._repository)
            ]

    def version_names(self) -> list[str]:
        """v1, v2, .. as far as they have not been given up, oldest first."""
        with self._faults("reading the history"):
            return snapshots.version_names(self._repository)

    def version(self, name: str | None = None) -> Version:
        """The named version, or the newest one.

        Raises:
            StoreError: there is none.
        """
        with self._faults("reading the history"):
            names = snapshots.version_names(self._repository)
            if not names or (name is not None and name not in names):
                what = "no version yet" if not names else f"no version {name!r} (it has {', '.join(names)})"
                raise StoreError(f"{self.object_id} has {what}", "see `glint history` or run the object")
            return snapshots.read_version(self._repository, name or names[-1])

    def published(self, keys: Keys) -> Version | None:
        """The newest version, if publishing captures whose results have these keys would change nothing."""
        with self._faults("reading the history"):
            names = snapshots.version_names(self._repository)
            newest = snapshots.read_version(self._repository, names[-1]) if names else None
            if newest is None or self._repository.lookup_branch("main") != newest.snapshot:
                return None
        same = all(of in (newest.stages.get(name), newest.rejected.get(name)) for name, of in keys.items())
        return replace(newest, created=False) if same else None

    def garbage_collect(self, dry_run: bool = False, keep: timedelta = timedelta(days=1)) -> Garbage:
        """Remove what no version and no branch's tip needs and is older than `keep`, which must outlast any save.

        A dry run removes nothing and counts what nothing refers to already, without what old work would set free.
        """

        return self._mutate("collecting garbage", lambda: collect(self._repository, self._place, keep, dry_run))

    def give_up(self, keep: int, dry_run: bool = False) -> list[str]:
        """Take all but the newest `keep` versions from history; their names. Their bytes are garbage from then on."""

        def attempt() -> list[str]:
            names = snapshots.version_names(self._repository)[: -max(1, keep)]
            for name in [] if dry_run else names:
                self._repository.delete_tag(name)
            return names

        return self._mutate("giving up versions", attempt)

    def _check(self, store: Any, capture: str, stages: Sequence[str]) -> None:
        whole = self._read_capture(store, capture)
        found = problems(whole, () if capture == WHOLE_OBJECT else stages)
        if found or not whole:
            raise StoreError(
                f"{self.object_id}/{capture} cannot be published: {'; '.join(found) or 'it has no result'}",
                "run the capture again",
            )

    def _read_capture(self, store: Any, capture: str) -> dict[str, StageResult]:
        results = {stage: read_stage(store, self.object_id, capture, stage) for stage in stage_keys(store, capture)}
        return {stage: result for stage, result in results.items() if result is not None}

    def _mutate[T](self, doing: str, change: Callable[[], T]) -> T:
        """Run `change` alone on a local store; on an object store run it again when another writer was faster."""
        with self._faults(doing), mutation_lock(self.location, self.object_id):
            for attempt in range(_ATTEMPTS):
                started = time.time()
                try:
                    outcome = change()
                    if self._place.local is not None:
                        flush_tree(self._place.local, started)
                    return outcome
                except icechunk.ConflictError:
                    time.sleep(uniform(0, min(2.0, 0.05 * 2**attempt)))
        raise StoreError(
            f"{doing} of {self.object_id} met other writers {_ATTEMPTS} times",
            "run again when fewer runs share the object",
        )

    @contextmanager
    def _faults(self, doing: str) -> Iterator[None]:
        with store_faults(self.location.uri, f"{doing} of object {self.object_id}"):
            yield
