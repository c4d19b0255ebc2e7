"""Versioned results of one object: an icechunk repository at STORE/objects/<id>/repo.

Branch `work` takes every stage's result as it finishes; resuming reads from there. A version is a snapshot that has been
checked, tagged v1, v2, ..; branch `main` is the newest one and what readers see by default. A version holds all its
captures' results itself, so any zarr reader opens it by its tag alone.

A rollback is a new version with an old one's content: nothing that was ever published is taken from history. It stands
until a key of the version it replaced changes: publishing the very results that were rolled back from makes no version.
"""

import re
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from random import uniform
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import icechunk
import zarr

from storage import blobs as blob_store
from storage.blobs import BlobReference
from storage.errors import StoreError
from storage.faults import store_faults
from storage.layout import REQUIRED_STAGES, problems
from storage.locks import mutation_lock
from storage.results import WHOLE_OBJECT, StageResult, check_name, jsonable, open_group, read_stage, write_stage

if TYPE_CHECKING:
    from storage.location import Location

icechunk.set_logs_filter("error")

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

_ATTEMPTS = 30


@dataclass(frozen=True, slots=True)
class Version:
    """A published version. `metadata` is the publisher's; `stages` the keys of its content by capture and stage;
    `rejected` the keys it was rolled back from; `created` False when publishing found nothing new."""

    name: str
    snapshot: str
    time: datetime
    message: str
    metadata: dict[str, Any] = field(default_factory=dict)
    stages: Keys = field(default_factory=dict)
    rejected: Keys = field(default_factory=dict)
    created: bool = True


@dataclass(frozen=True, slots=True)
class Garbage:
    """What a collection removed, or would remove: objects of the repository and their bytes."""

    objects: int
    bytes: int
    snapshots: int


class ObjectRepository:
    """Results of one object; safe to use from several processes at once, each with its own instance."""

    def __init__(self, location: "Location", object_id: str, repository: icechunk.Repository) -> None:
        self.location, self.object_id, self._repository = location, object_id, repository

    @classmethod
    def open(cls, location: "Location", object_id: str, create: bool = True) -> "ObjectRepository":
        """The object's repository, made where it is absent if `create`.

        Raises:
            StoreError: no such object, an id that cannot name one, or the store cannot be used.
        """
        place = location.child("objects", check_name(object_id, "object"), "repo")
        with store_faults(place.uri, f"opening object {object_id}"):
            try:
                repository = icechunk.Repository.open(place.icechunk_storage())
                if not create or "work" in repository.list_branches():
                    return cls(location, object_id, repository)
            except icechunk.RepositoryNotFoundError:
                if not create:
                    raise StoreError(
                        f"no object {object_id} in {location.uri}", "see `glint status` for what is there"
                    ) from None
            with mutation_lock(location, object_id):
                return cls(location, object_id, _open_or_create(place))

    def stage_key(self, capture: str, stage: str, ref: str = "work") -> str | None:
        """Key under which the stage was saved last, or None."""
        with self._faults(f"reading {capture}/{stage}"):
            return _keys(self._session(ref).store, capture).get(stage)

    def save(
        self,
        capture: str,
        stage: str,
        key: str,
        arrays: Mapping[str, Any],
        record: Mapping[str, Any],
        blobs: Mapping[str, BlobReference] | None = None,
    ) -> str:
        """Replace the stage's result whole, in one commit on `work`; the snapshot's id.

        Whoever reads meanwhile sees the old result or the new one. Acknowledged only once it is stored.
        """

        def write() -> str:
            session = self._repository.writable_session("work")
            write_stage(session.store, capture, stage, key, arrays, record, blobs or {})
            metadata = {"capture": capture, "stage": stage, "key": key}
            return str(session.commit(f"{capture}/{stage}", metadata, rebase_with=icechunk.ConflictDetector()))

        return self._mutate(f"saving {capture}/{stage}", write)

    def load(self, capture: str, stage: str, ref: str = "work") -> StageResult:
        """The stage's result on a branch, in a version ("v2") or in a snapshot.

        Raises:
            StoreError: it is not there.
        """
        with self._faults(f"reading {capture}/{stage}"):
            result = read_stage(self._session(ref).store, capture, stage)
        if result is None:
            raise StoreError(f"{self.object_id} has no {capture}/{stage} in {ref}", "run the object first")
        return result

    def captures(self, ref: str = "work") -> list[str]:
        """Captures with a result, sorted; WHOLE_OBJECT is none of them."""
        return [name for name in self.contents(ref) if name != WHOLE_OBJECT]

    def contents(self, ref: str = "work") -> Keys:
        """Stage keys by capture and stage, WHOLE_OBJECT included."""
        with self._faults("listing"):
            return _contents(self._session(ref).store)

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
            StoreError: a result is missing, malformed or names a blob that is not there; nothing has changed then.
        """

        def attempt() -> Version:
            current = self._settle()
            base = self._repository.lookup_branch("work")
            work = self._session(base).store
            keys = {capture: _keys(work, capture) for capture in captures}
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
            return self._version(
                base, current, kept | new, kept, {c: k for c, k in rejected.items() if c not in new}, metadata, message
            )

        return self._mutate("publishing", attempt)

    def rollback(self, version: str, message: str = "") -> Version:
        """Make a new version with the content of an old one; rolling back to the current one makes none."""

        def attempt() -> Version:
            current, target = self._settle(), self.version(version)
            if current is None or target.snapshot == current.snapshot:
                return replace(target, created=False)
            rejected = {c: of for c, of in current.stages.items() if of != target.stages.get(c)}
            metadata = target.metadata | {"rolled_back_to": target.name, "replaces": current.name}
            text = message or f"roll back from {current.name} to {target.name}"
            return self._version(target.snapshot, current, target.stages, {}, rejected, metadata, text)

        return self._mutate("rolling back", attempt)

    def history(self) -> list[Version]:
        """All versions, oldest first."""
        with self._faults("reading the history"):
            return [self._tagged(name) for name in self._names()]

    def version(self, name: str | None = None) -> Version:
        """The named version, or the newest one.

        Raises:
            StoreError: there is none.
        """
        with self._faults("reading the history"):
            names = self._names()
            if not names or (name is not None and name not in names):
                what = "no version yet" if not names else f"no version {name!r} (it has {', '.join(names)})"
                raise StoreError(f"{self.object_id} has {what}", "see `glint history` or run the object")
            return self._tagged(name or names[-1])

    def garbage_collect(self, dry_run: bool = False, keep: timedelta = timedelta(days=1)) -> Garbage:
        """Remove what no version and no branch's tip needs and is older than `keep`, which must outlast any save."""

        def collect() -> Garbage:
            limit = datetime.now(UTC) - keep
            if not dry_run:
                self._drop_stale_branches(limit)
                self._repository.expire_snapshots(limit)
            summary = self._repository.garbage_collect(limit, dry_run=dry_run)
            parts = (summary.chunks_deleted, summary.manifests_deleted, summary.snapshots_deleted)
            objects = sum(parts) + summary.attributes_deleted + summary.transaction_logs_deleted
            return Garbage(objects, summary.bytes_deleted, summary.snapshots_deleted)

        return self._mutate("collecting garbage", collect)

    def _version(
        self,
        base: str,
        current: Version | None,
        stages: Keys,
        kept: Keys,
        rejected: Keys,
        metadata: Mapping[str, Any],
        message: str,
    ) -> Version:
        """Commit, on a branch of its own from snapshot `base`, exactly `stages`, of which `kept` as in `current`; tag it.

        The tag makes the version; `main` follows, and `_settle` moves it if this process dies in between.
        """
        name = f"v{int(current.name[1:]) + 1 if current else 1}"
        branch = f"publish-{uuid4().hex}"
        self._repository.create_branch(branch, base)
        try:
            session = self._repository.writable_session(branch)
            root = zarr.open_group(session.store, mode="a", use_consolidated=False)
            present = _contents(session.store)
            for capture in present.keys() - stages.keys():
                del root[capture]
            for capture in kept:
                if present.get(capture) != kept[capture]:
                    self._copy(session.store, current, capture)
            metadata = jsonable(metadata)
            record = {"version": name, "stages": stages, "rejected": rejected, "metadata": metadata}
            root.attrs.put({"object": self.object_id, "version": name, "metadata": metadata})
            snapshot = session.commit(message or f"version {name}", record)
            self._repository.create_tag(name, snapshot)
        except icechunk.AlreadyExistsError as error:
            raise icechunk.ConflictError() from error
        finally:
            self._repository.delete_branch(branch)
        self._settle()
        return self._tagged(name)

    def _copy(self, store: Any, current: Version | None, capture: str) -> None:
        """Write the capture as the current version has it over what `work` has."""
        assert current is not None
        source = self._session(current.snapshot).store
        root = zarr.open_group(store, mode="a", use_consolidated=False)
        if capture in root:
            del root[capture]
        for stage in current.stages[capture]:
            result = read_stage(source, capture, stage)
            assert result is not None
            write_stage(store, capture, stage, result.key, result.arrays, result.record, result.blobs)

    def _check(self, store: Any, capture: str, stages: Sequence[str]) -> None:
        results = {stage: read_stage(store, capture, stage) for stage in _keys(store, capture)}
        whole = {stage: result for stage, result in results.items() if result is not None}
        found = problems(whole, () if capture == WHOLE_OBJECT else stages)
        for stage, result in whole.items():
            lost = [name for name, reference in result.blobs.items() if not blob_store.exists(self.location, reference)]
            found += [f"{stage} names {name}, which is not in the store" for name in lost]
        if found or not whole:
            raise StoreError(
                f"{self.object_id}/{capture} cannot be published: {'; '.join(found) or 'it has no result'}",
                "run the capture again",
            )

    def _settle(self) -> Version | None:
        """The newest version, with `main` moved there if a publisher died before it could."""
        names = self._names()
        if not names:
            return None
        newest, main = self._tagged(names[-1]), self._repository.lookup_branch("main")
        if main != newest.snapshot:
            try:
                self._repository.reset_branch("main", newest.snapshot, from_snapshot_id=main)
            except icechunk.ConflictError:
                return self._settle()
        return newest

    def _names(self) -> list[str]:
        tags = [tag for tag in self._repository.list_tags() if re.fullmatch(r"v[1-9]\d*", tag)]
        return sorted(tags, key=lambda tag: int(tag[1:]))

    def _tagged(self, name: str) -> Version:
        info = self._repository.lookup_snapshot(self._repository.lookup_tag(name))
        of = info.metadata
        return Version(name, info.id, info.written_at, info.message, of["metadata"], of["stages"], of["rejected"])

    def _session(self, ref: str) -> icechunk.Session:
        try:
            if ref in ("main", "work"):
                return self._repository.readonly_session(ref)
            if re.fullmatch(r"v\d+", ref):
                return self._repository.readonly_session(tag=ref)
            return self._repository.readonly_session(snapshot_id=ref)
        except (icechunk.NotFoundError, icechunk.InvalidInputError, ValueError) as error:
            raise StoreError(f"{self.object_id} has no version {ref!r}", "see `glint history`") from error

    def _drop_stale_branches(self, limit: datetime) -> None:
        for branch in self._repository.list_branches():
            if branch.startswith("publish-"):
                written = self._repository.lookup_snapshot(self._repository.lookup_branch(branch)).written_at
                if written < limit:
                    self._repository.delete_branch(branch)

    def _mutate[T](self, doing: str, change: Callable[[], T]) -> T:
        """Run `change` alone on a local store; on an object store run it again when another writer was faster."""
        with self._faults(doing), mutation_lock(self.location, self.object_id):
            for attempt in range(_ATTEMPTS):
                try:
                    return change()
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


def _open_or_create(place: "Location") -> icechunk.Repository:
    try:
        repository = icechunk.Repository.open(place.icechunk_storage())
    except icechunk.RepositoryNotFoundError:
        repository = icechunk.Repository.open_or_create(place.icechunk_storage())
    if "work" not in repository.list_branches():
        try:
            repository.create_branch("work", repository.lookup_branch("main"))
        except (icechunk.AlreadyExistsError, icechunk.ConflictError):
            if "work" not in repository.list_branches():
                raise
    return repository


def _contents(store: Any) -> Keys:
    root = open_group(store, "")
    return {} if root is None else {name: _keys(store, name) for name in sorted(root.group_keys())}


def _keys(store: Any, capture: str) -> dict[str, str]:
    """Key of each stage of a capture that has one."""
    group = open_group(store, check_name(capture, "capture"))
    stages = {} if group is None else dict(group.groups())
    return {name: str(stage.attrs["key"]) for name, stage in sorted(stages.items()) if "key" in stage.attrs}
