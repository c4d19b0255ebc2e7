"""Versioned results of one object: an icechunk repository at STORE/objects/<id>/repo.

Branch `work` takes the result of every stage as it finishes; a resumed run reads from there. A version is a checked
snapshot with a tag v1, v2, ..; branch `main` is the newest version, which readers see by default. A version holds the
results of all its captures itself, so any zarr reader opens it by its tag alone.

A rollback is a new version with the content of an older one, and stands until the results change: publishing the very
results that this rollback or those before it left creates no version.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

import icechunk
import obstore

from glint.storage.errors import StoreError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.locations.store_folder import check_store
from glint.storage.versions import publication, snapshots
from glint.storage.versions.array_schema import NO_SCHEMAS, Schemas, VersionSchema
from glint.storage.versions.garbage import Garbage, collect, prune
from glint.storage.versions.opening import open_existing
from glint.storage.versions.snapshots import Version, index_errors, read_session
from glint.storage.versions.stage_results import WHOLE_OBJECT, Keys, StageResult, StoredFile
from glint.storage.versions.stages.names import check_name, is_name
from glint.storage.versions.stages.reader import (
    check_layout,
    contents,
    read_capture,
    read_stage,
    saved_key,
    stage_attributes,
)
from glint.storage.versions.stages.writer import write_stage
from glint.storage.versions.transaction import create_repository, repository_folder, transaction

icechunk.set_logs_filter("off")  # what it logs it also raises


def object_ids(location: Location) -> list[str]:
    """Return the ids of all objects of a store, sorted; none where there is no store yet."""
    folder = location.child("objects")
    if folder.local is not None and not folder.local.is_dir():
        return []
    with store_errors(location.uri, "listing objects"):
        prefixes = obstore.list_with_delimiter(folder.obstore())["common_prefixes"]
    # Folders of other names were not written by Glint.
    return sorted(filter(is_name, (prefix.strip("/").rpartition("/")[2] for prefix in prefixes)))


class ObjectRepository:
    """Results of one object; safe to use from several processes at once, each with its own instance."""

    def __init__(self, location: Location, object_id: str, repository: icechunk.Repository) -> None:
        self.location, self.object_id, self._repository = location, object_id, repository
        self._folder = repository_folder(location, object_id)

    @classmethod
    def open(cls, location: Location, object_id: str, create: bool = True) -> "ObjectRepository":
        """Open the object's repository; with `create`, create it where it is absent.

        Raises:
            StoreError: no such object, an id that cannot name one, the layout of another version of Glint, or the store
                cannot be used.
        """
        folder = repository_folder(location, check_name(object_id, "object"))
        with index_errors(location.uri, "opening it", object_id):
            repository = open_existing(folder, object_id)
            if repository is None and not create:
                check_store(location)
                raise StoreError(f"no object {object_id} in {location.uri}", "see `glint status` for its objects")
            if repository is None or (create and "work" not in repository.list_branches()):
                return cls(location, object_id, create_repository(location, object_id))
            check_layout(read_session(repository, object_id, "work").store, object_id, location.uri)
            return cls(location, object_id, repository)

    @property
    def index(self) -> icechunk.Repository:
        """The icechunk repository, which holds the edits of the object's inputs as well."""
        return self._repository

    def stage_key(self, capture: str, stage: str, ref: str = "work") -> str | None:
        """Return the key under which the stage was saved last, or None."""
        with self._errors(f"reading {capture}/{stage}"):
            return saved_key(self._store(ref), self.object_id, capture, stage)

    def records(self, capture: str, ref: str = "work") -> dict[str, tuple[str, dict[str, Any]]]:
        """Return key and record of the saved stages of a capture, without their arrays."""
        with self._errors(f"reading {capture}"):
            saved = stage_attributes(self._store(ref), self.object_id, capture).items()
            return {stage: (attributes["key"], attributes["record"]) for stage, attributes in saved}

    def save(
        self,
        capture: str,
        stage: str,
        key: str,
        arrays: Mapping[str, Any],
        record: Mapping[str, Any],
        files: Mapping[str, StoredFile] | None = None,
    ) -> str:
        """Replace the stage's result as a whole, durably, in one commit on `work`; return the snapshot's id.

        Raises:
            StoreError: the store cannot be written, or a name cannot be used there.
        """

        def write() -> str:
            session = self._repository.writable_session("work")
            write_stage(session.store, self.object_id, capture, stage, key, arrays=arrays, record=record, files=files)
            metadata = {"capture": capture, "stage": stage, "key": key}
            return str(session.commit(f"{capture}/{stage}", metadata, rebase_with=icechunk.ConflictDetector()))

        return self._transaction(f"saving {capture}/{stage}", write)

    def load(self, capture: str, stage: str, ref: str = "work") -> StageResult:
        """Return the stage's result on a branch, in a version ("v2") or in a snapshot.

        Raises:
            StoreError: there is none.
        """
        with self._errors(f"reading {capture}/{stage}"):
            version = snapshots.version_at(self._repository, self.object_id, ref)
            if version is not None:
                result = snapshots.version_results(self._repository, self.object_id, version, capture, (stage,)).get(
                    stage
                )
            else:
                result = read_stage(self._store(ref), self.object_id, capture, stage)
        if result is None:
            raise StoreError(f"{self.object_id} has no {capture}/{stage} in {ref}", "run the object first")
        return result

    def load_capture(self, capture: str, ref: str = "work") -> dict[str, StageResult]:
        """Return all results of a capture by stage, read in one session, which is faster than one stage at a time.

        Raises:
            DamagedError: one is damaged.
        """
        with self._errors(f"reading {capture}"):
            version = snapshots.version_at(self._repository, self.object_id, ref)
            if version is not None:
                return snapshots.version_results(self._repository, self.object_id, version, capture)
            return read_capture(self._store(ref), self.object_id, capture)

    def captures(self, ref: str = "work") -> list[str]:
        """Return the captures that have a result, sorted, without WHOLE_OBJECT."""
        return [name for name in self.contents(ref) if name != WHOLE_OBJECT]

    def contents(self, ref: str = "work") -> Keys:
        """Return the stage keys by capture and stage, WHOLE_OBJECT included."""
        with self._errors("listing"):
            return contents(self._store(ref), self.object_id)

    def publish(
        self,
        captures: Sequence[str],
        metadata: Mapping[str, Any],
        required: Sequence[str] = (),
        message: str = "",
        remove: Collection[str] = (),
        schemas: Schemas = NO_SCHEMAS,
    ) -> Version:
        """Publish the named captures' results on `work` as a version: tag it and move `main` there.

        Other captures stay as they are in the current version; what is damaged in it counts as changed. If nothing
        changes, return the current version with `created` False.

        required: stages that a capture must have; remove: captures to leave out; schemas: of the arrays.

        Raises:
            StoreError: a result is missing or malformed; nothing has changed then.
        """
        schema = VersionSchema(required, schemas)
        return self._transaction(
            "publishing",
            lambda: publication.publish(
                self._repository, self.object_id, captures, schema, metadata=metadata, message=message, removed=remove
            ),
        )

    def rollback(self, version: str, message: str = "") -> Version:
        """Make a version with the content of an older one; if the newest has it, undamaged, return that, not `created`.

        Raises:
            StoreError: there is no such version; DamagedError: it is damaged.
        """
        return self._transaction(
            "rolling back",
            lambda: publication.rollback(self._repository, self.object_id, self.version(version), message),
        )

    def history(self) -> list[Version]:
        """Return all versions, oldest first."""
        with self._errors("reading the history"):
            names = snapshots.version_names(self._repository, self.object_id)
            return [snapshots.read_version(self._repository, self.object_id, name) for name in names]

    def version_names(self) -> list[str]:
        """Return the names (v1, v2, ..) of all versions that have not been pruned, oldest first."""
        with self._errors("reading the history"):
            return snapshots.version_names(self._repository, self.object_id)

    def version(self, name: str | None = None) -> Version:
        """Return the named version, or the newest one.

        Raises:
            StoreError: there is none.
        """
        with self._errors("reading the history"):
            return snapshots.find_version(self._repository, self.object_id, name)

    def published(self, keys: Keys) -> Version | None:
        """Return the newest version if publishing results with these keys would change nothing, else None."""
        with self._errors("reading the history"):
            return publication.published(self._repository, self.object_id, keys)

    def garbage_collect(self, dry_run: bool = False, min_age: timedelta = timedelta(days=1)) -> Garbage:
        """Remove what neither a version nor a branch needs and is older than `min_age`.

        min_age: must exceed the duration of any save. A dry run removes nothing and counts only what is unreferenced
        already, without the replaced results that collection would release first.
        """
        return self._transaction(
            "cleaning up", lambda: collect(self._repository, self._folder, min_age, dry_run), dry_run
        )

    def prune(self, keep: int, dry_run: bool = False) -> list[str]:
        """Remove all but the newest `keep` versions from the history; return their names. Their data become garbage."""
        return self._transaction("pruning", lambda: prune(self._repository, self.object_id, keep, dry_run), dry_run)

    def _store(self, ref: str) -> Any:
        return read_session(self._repository, self.object_id, ref).store

    def _transaction[T](self, action: str, change: Callable[[], T], dry_run: bool = False) -> T:
        return transaction(self.location, self.object_id, action, change, dry_run)

    @contextmanager
    def _errors(self, action: str) -> Iterator[None]:
        with index_errors(self.location.uri, action, self.object_id):
            yield
