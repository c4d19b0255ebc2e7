"""Branches, tags and snapshots of an object's icechunk repository: opening it, and reading its versions."""

import re
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import icechunk
import obstore

from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import Keys

# Every commit is a new snapshot of the whole object. With icechunk's default limits their cache takes a hundred
# megabytes for each open object; only the newest snapshots are read again.
_CONFIG = icechunk.RepositoryConfig(caching=icechunk.CachingConfig(num_snapshot_nodes=10_000, num_chunk_refs=100_000))


@dataclass(frozen=True, slots=True)
class Version:
    """A published version.

    metadata: as given by the publisher
    stages: keys of its content by capture and stage
    rolled_back: keys of the results from which a rollback led to this content; publishing these again has no effect
    created: False if publishing found nothing new
    """

    name: str
    snapshot: str
    time: datetime
    message: str
    metadata: dict[str, Any] = field(default_factory=dict)
    stages: Keys = field(default_factory=dict)
    rolled_back: Keys = field(default_factory=dict)
    created: bool = True


def open_repository(location: Location) -> icechunk.Repository:
    """Open an existing repository.

    Raises:
        RepositoryNotFoundError: there is none.
    """
    return icechunk.Repository.open(location.icechunk_storage(), config=_CONFIG)


def open_or_create(location: Location) -> icechunk.Repository:
    """Open the repository and its branch `work`; create what is missing, also after an interrupted creation.

    Raises:
        StoreError: there are results but no index of them.
    """
    try:
        repository = open_repository(location)
    except icechunk.RepositoryNotFoundError:
        snapshots = [meta for batch in obstore.list(location.obstore(), prefix="snapshots") for meta in batch]
        # An interrupted creation leaves at most the initial snapshot; with more, creating would hide results.
        if len(snapshots) > 1:
            remedy = "copy the newest file of its folder overwritten/ to the name repo, or restore a backup"
            raise StoreError(f"{location.uri} has lost the file repo, the index of its results", remedy) from None
        with suppress(icechunk.ConflictError):
            icechunk.Repository.create(location.icechunk_storage(), check_clean_root=False)
        repository = open_repository(location)
    if "work" not in repository.list_branches():
        with suppress(icechunk.AlreadyExistsError, icechunk.ConflictError):
            repository.create_branch("work", repository.lookup_branch("main"))
    return repository


def read_session(repository: icechunk.Repository, ref: str) -> icechunk.Session:
    """Open a read-only session at a branch, a version's name or a snapshot's id.

    Raises:
        StoreError: the repository has no such branch, version or snapshot.
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
    """Return v1, v2, .. in order."""
    tags = [tag for tag in repository.list_tags() if re.fullmatch(r"v[1-9]\d*", tag)]
    return sorted(tags, key=lambda tag: int(tag[1:]))


def read_version(repository: icechunk.Repository, name: str) -> Version:
    """Return the version from its tag and its commit's metadata.

    Raises:
        StoreError: Glint did not make the tag.
    """
    snapshot = repository.lookup_snapshot(repository.lookup_tag(name))
    record = snapshot.metadata
    try:
        facts = record["metadata"], record["stages"], record["rolled_back"]
    except KeyError as error:
        raise StoreError(f"tag {name} was not made by Glint (no {error} in its commit)", "delete the tag") from error
    return Version(name, snapshot.id, snapshot.written_at, snapshot.message, *facts)


def find_version(repository: icechunk.Repository, object_id: str, name: str | None) -> Version:
    """Return the named version, or the newest one.

    Raises:
        StoreError: there is none.
    """
    names = version_names(repository)
    if not names or (name is not None and name not in names):
        absence = "no version yet" if not names else f"no version {name!r} (it has {', '.join(names)})"
        raise StoreError(f"{object_id} has {absence}", "see `glint history` or run the object")
    return read_version(repository, name or names[-1])


def newest_version(repository: icechunk.Repository) -> Version | None:
    """Return the newest version, or None before the first."""
    names = version_names(repository)
    return read_version(repository, names[-1]) if names else None
