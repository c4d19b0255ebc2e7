"""Branches, tags and snapshots of an object's icechunk repository: how a version is found, made and settled."""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

import icechunk
import obstore
import zarr

from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import (
    LAYOUT_NUMBER,
    Keys,
    StoredFile,
    contents,
    jsonable,
    read_stage,
    write_stage,
)

# Every commit is a new snapshot of the whole object. As many as icechunk remembers by default are a hundred megabytes
# for each object that is open; the newest are all that is read again.
_CONFIG = icechunk.RepositoryConfig(caching=icechunk.CachingConfig(num_snapshot_nodes=10_000, num_chunk_refs=100_000))


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


def open_repository(place: Location) -> icechunk.Repository:
    """The repository that is there.

    Raises:
        RepositoryNotFoundError: none is.
    """
    return icechunk.Repository.open(place.icechunk_storage(), config=_CONFIG)


def open_or_create(place: Location) -> icechunk.Repository:
    """The repository with its branch `work`, whatever of them is missing, even after a death while they were made.

    Raises:
        StoreError: there are results but no index of them.
    """
    try:
        repository = open_repository(place)
    except icechunk.RepositoryNotFoundError:
        snapshots = [meta for batch in obstore.list(place.obstore(), prefix="snapshots") for meta in batch]
        if len(snapshots) > 1:
            remedy = "copy the newest file of its folder overwritten/ to the name repo, or restore a backup"
            raise StoreError(f"{place.uri} has lost the file repo, the index of its results", remedy) from None
        with suppress(icechunk.ConflictError):
            icechunk.Repository.create(place.icechunk_storage(), check_clean_root=False)
        repository = open_repository(place)
    if "work" not in repository.list_branches():
        with suppress(icechunk.AlreadyExistsError, icechunk.ConflictError):
            repository.create_branch("work", repository.lookup_branch("main"))
    return repository


def session(repository: icechunk.Repository, ref: str) -> icechunk.Session:
    """For reading: a branch, a version's name or a snapshot's id.

    Raises:
        StoreError: none is called so.
    """
    try:
        if ref in ("main", "work"):
            return repository.readonly_session(ref)
        if re.fullmatch(r"v\d+", ref):
            return repository.readonly_session(tag=ref)
        return repository.readonly_session(snapshot_id=ref)
    except (icechunk.NotFoundError, icechunk.InvalidInputError, ValueError) as error:
        raise StoreError(f"no version {ref!r} in this repository", "see `glint history`") from error


def version_names(repository: icechunk.Repository) -> list[str]:
    """v1, v2, .. in order."""
    tags = [tag for tag in repository.list_tags() if re.fullmatch(r"v[1-9]\d*", tag)]
    return sorted(tags, key=lambda tag: int(tag[1:]))


def read_version(repository: icechunk.Repository, name: str) -> Version:
    """The version from its tag and its commit's metadata."""
    info = repository.lookup_snapshot(repository.lookup_tag(name))
    try:
        of = info.metadata
        return Version(name, info.id, info.written_at, info.message, of["metadata"], of["stages"], of["rejected"])
    except KeyError as error:
        raise StoreError(f"tag {name} was not made by Glint (no {error} in its commit)", "delete the tag") from error


def settle(repository: icechunk.Repository) -> Version | None:
    """The newest version, with `main` moved there if a publisher died before it could."""
    names = version_names(repository)
    if not names:
        return None
    newest, main = read_version(repository, names[-1]), repository.lookup_branch("main")
    if main != newest.snapshot:
        try:
            repository.reset_branch("main", newest.snapshot, from_snapshot_id=main)
        except icechunk.ConflictError:
            return settle(repository)
    return newest


def successor(
    current: Version | None, stages: Keys, rejected: Keys, metadata: Mapping[str, Any], message: str
) -> Version:
    """The version that would follow `current`, without a snapshot yet."""
    name = f"v{int(current.name[1:]) + 1 if current else 1}"
    return Version(name, "", datetime.now(UTC), message or f"version {name}", jsonable(metadata), stages, rejected)


def commit_version(
    repository: icechunk.Repository, object_id: str, base: str, current: Version | None, version: Version, kept: Keys
) -> Version:
    """Commit, from snapshot `base`, exactly `version.stages`, of which `kept` as `current` has them, and tag it.

    The commit is made on a branch of its own, so `work` goes on undisturbed. The tag makes the version; `main` follows,
    and `settle` moves it if this process dies in between.

    Raises:
        icechunk.ConflictError: another publisher took the name first.
    """
    branch = f"publish-{uuid4().hex}"
    repository.create_branch(branch, base)
    try:
        writable = repository.writable_session(branch)
        root = zarr.open_group(writable.store, mode="a", use_consolidated=False)
        present = contents(writable.store)
        for capture in present.keys() - version.stages.keys():
            del root[capture]
        for capture in kept:
            if current is not None and present.get(capture) != kept[capture]:
                _copy(repository, object_id, writable.store, current, capture)
        root.attrs.put({"layout": LAYOUT_NUMBER, "version": version.name, "metadata": version.metadata})
        record = {"stages": version.stages, "rejected": version.rejected, "metadata": version.metadata}
        repository.create_tag(version.name, writable.commit(version.message, record))
    except icechunk.AlreadyExistsError as error:
        raise icechunk.ConflictError() from error
    finally:
        repository.delete_branch(branch)
    settle(repository)
    return read_version(repository, version.name)


def drop_stale_branches(repository: icechunk.Repository, limit: datetime) -> None:
    """Delete the branches of publishers that died, older than `limit`."""
    for branch in repository.list_branches():
        if branch.startswith("publish-"):
            written = repository.lookup_snapshot(repository.lookup_branch(branch)).written_at
            if written < limit:
                repository.delete_branch(branch)


def _copy(repository: icechunk.Repository, object_id: str, store: Any, current: Version, capture: str) -> None:
    """Write the capture as `current` has it over what `store` has."""
    source = session(repository, current.snapshot).store
    root = zarr.open_group(store, mode="a", use_consolidated=False)
    if capture in root:
        del root[capture]
    for stage in current.stages[capture]:
        result = read_stage(source, object_id, capture, stage)
        if result is None:
            raise StoreError(f"{current.name} has lost {capture}/{stage}", "restore the object from a backup")
        files = {name: StoredFile(result.read_file(name), info.media_type) for name, info in result.files.items()}
        write_stage(store, capture, stage, result.key, result.arrays, result.record, files)
