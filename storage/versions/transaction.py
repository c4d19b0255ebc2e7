"""Transactions: one change of an object's repository at a time, durable once it is acknowledged."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from random import uniform

import icechunk

from glint.storage.errors import StoreError
from glint.storage.fsync import flush_new_tree, flush_tree
from glint.storage.locations.location import Location
from glint.storage.locking.locks import mutation_lock
from glint.storage.versions.opening import open_or_create
from glint.storage.versions.snapshots import index_errors

MAX_COMMIT_ATTEMPTS = 30
"""Conflicts with other writers after which a change is given up, within a minute of waiting."""
FIRST_BACKOFF_SECONDS, MAX_BACKOFF_SECONDS = 0.05, 2.0
"""Longest wait after the first conflict, which doubles with each further one, and its limit."""


def repository_folder(location: Location, object_id: str) -> Location:
    """Return the folder of an object's repository in a store."""
    return location.child("objects", object_id, "repo")


def create_repository(location: Location, object_id: str) -> icechunk.Repository:
    """Open an object's repository, created durably where it is absent.

    Raises:
        DamagedError: there are results but no index of them.
    """
    folder = repository_folder(location, object_id)
    with mutation_lock(location, object_id):
        repository = open_or_create(folder, object_id)
        # Later changes flush what they write, in folders whose own entries must be on the disk.
        if folder.local is not None and location.local is not None:
            flush_new_tree(folder.local, location.local)
    return repository


def transaction[T](
    location: Location, object_id: str, action: str, change: Callable[[], T], dry_run: bool = False
) -> T:
    """Run `change` under a lock on a local store; on an object store, repeat it after conflicts with other writers.

    action: what the change does, for messages; dry_run: it only reads, also a store that may not be written.

    Raises:
        StoreError: the store cannot be written, or other writers were faster every time.
    """
    folder = repository_folder(location, object_id)
    lock = nullcontext() if dry_run else mutation_lock(location, object_id)
    with index_errors(location.uri, f"{action} of object {object_id}", object_id), lock:
        for attempt in range(MAX_COMMIT_ATTEMPTS):
            started = time.time()
            try:
                result = change()
                if folder.local is not None and not dry_run:
                    flush_tree(folder.local, started)
                return result
            except icechunk.ConflictError:
                # Random exponential backoff, so that the same writers do not meet again.
                time.sleep(uniform(0, min(MAX_BACKOFF_SECONDS, FIRST_BACKOFF_SECONDS * 2**attempt)))
    raise StoreError(
        f"{action} of {object_id} met other writers {MAX_COMMIT_ATTEMPTS} times",
        "run again when fewer runs share the object",
    )
