"""Garbage collection of an object: replaced results, icechunk's copies of its index, and old files of caches."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import icechunk
import obstore

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.versions.snapshots import version_names

BRANCH_PREFIX = "publish-"
"""Beginning of the names of the branches on which versions are made; the second of their creation follows."""


@dataclass(frozen=True, slots=True)
class Garbage:
    """Number and bytes of the files (in an object store: objects) that were removed, or would be."""

    objects: int
    bytes: int


def collect(repository: icechunk.Repository, location: Location, min_age: timedelta, dry_run: bool) -> Garbage:
    """Remove what neither a version nor a branch refers to and what is older than `min_age`.

    location: of the repository itself.
    """
    limit = datetime.now(UTC) - min_age
    if not dry_run:
        delete_stale_branches(repository, limit)
        repository.expire_snapshots(limit)
    summary = repository.garbage_collect(limit, dry_run=dry_run)
    parts = (summary.chunks_deleted, summary.manifests_deleted, summary.snapshots_deleted)
    objects = sum(parts) + summary.attributes_deleted + summary.transaction_logs_deleted
    copies = _index_copies(location, limit)
    if not dry_run and copies:
        obstore.delete(location.obstore(), list(copies))
    return Garbage(objects + len(copies), summary.bytes_deleted + sum(copies.values()))


def prune(repository: icechunk.Repository, object_id: str, keep: int, dry_run: bool) -> list[str]:
    """Delete the tags of all but the newest `keep` versions; return their names."""
    names = version_names(repository, object_id)[: -max(1, keep)]
    for name in [] if dry_run else names:
        repository.delete_tag(name)
    return names


def remove_old_files(location: Location, object_id: str, folder: str, min_age: timedelta, dry_run: bool) -> Garbage:
    """Remove the files in an object's folder that are older than `min_age`: a cache, whose users write what they need.

    location: of the store.
    """
    limit, store = datetime.now(UTC) - min_age, location.child("objects", object_id).obstore()
    with store_errors(location.uri, f"listing {folder} of {object_id}"):
        listed = [meta for batch in obstore.list(store, prefix=folder) for meta in batch]
        old = {meta["path"]: meta["size"] for meta in listed if meta["last_modified"] < limit}
        if old and not dry_run:
            obstore.delete(store, list(old))
    return Garbage(len(old), sum(old.values()))


def delete_stale_branches(repository: icechunk.Repository, limit: datetime) -> None:
    """Delete the branches, older than `limit`, of publishers that died."""
    for branch in repository.list_branches():
        # A snapshot may be far older than the branch that was created from it.
        created = re.fullmatch(rf"{BRANCH_PREFIX}(\d+)-\w+", branch)
        if created and int(created[1]) < limit.timestamp():
            repository.delete_branch(branch)


def new_branch_name() -> str:
    """Return the name of a new branch on which a version is made."""
    return f"{BRANCH_PREFIX}{int(datetime.now(UTC).timestamp())}-{uuid4().hex}"


def _index_copies(location: Location, limit: datetime) -> dict[str, int]:
    """Return bytes by key of the copies that icechunk makes of its index at every commit, without the newest."""
    listed = [meta for batch in obstore.list(location.obstore(), prefix="overwritten") for meta in batch]
    newest = max((meta["last_modified"] for meta in listed), default=limit)
    return {meta["path"]: meta["size"] for meta in listed if meta["last_modified"] < min(limit, newest)}
