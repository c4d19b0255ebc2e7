"""Locks beside an object's repository: one around every mutation, one around a whole run of the object.

In a local store they are locks of the operating system, which releases them when their process ends, however it ends.
In an object store mutations need no lock, and a run holds a lease.
"""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.locking.leases import lease, lease_owner
from glint.storage.locking.owner import LockOwner, ObjectBusy

MAX_STATUS_CHECK_SECONDS = 1.0
"""Upper bound of the time for which a status check holds a lock."""
STATUS_CHECK_POLL_SECONDS = 0.01
"""Interval at which a lock that a status check may hold is tried again."""
MAX_OWNER_BYTES = 4096
"""Bytes that are read of a lock's file; an owner takes a few hundred."""


@contextmanager
def mutation_lock(location: Location, object_id: str) -> Iterator[None]:
    """Wait for, then hold, the exclusive right to change an object's repository.

    On a local file system two concurrent commits could overwrite each other silently. Object stores refuse the second
    commit, so nothing is locked there.
    """
    if location.local is None:
        yield
        return
    with _open(location, object_id, "repo.lock") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@contextmanager
def run_lock(location: Location, object_id: str, run: str = "") -> Iterator[None]:
    """Hold an object's lock for one run.

    Raises:
        ObjectBusy: another run holds it.
    """
    if location.local is None:
        with lease(location, object_id, run):
            yield
        return
    with _open(location, object_id, "run.lock") as handle:
        _acquire(handle, object_id)
        os.ftruncate(handle, 0)
        os.pwrite(handle, LockOwner.this_process(run).as_bytes(), 0)
        try:
            yield
        finally:
            os.ftruncate(handle, 0)


def run_owner(location: Location, object_id: str) -> LockOwner | None:
    """Return the owner of the object's run lock, or None if the object is not being run."""
    if location.local is None:
        return lease_owner(location, object_id)
    if not _path(location.local, object_id, "run.lock").exists():
        return None
    with _open(location, object_id, "run.lock", os.O_RDONLY) as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return LockOwner.from_bytes(os.pread(handle, MAX_OWNER_BYTES, 0))
        return None


def _acquire(handle: int, object_id: str) -> None:
    """Acquire the lock. Status checks hold it briefly without recording an owner, so wait for those."""
    deadline = time.monotonic() + MAX_STATUS_CHECK_SECONDS
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError as error:
            owner = LockOwner.from_bytes(os.pread(handle, MAX_OWNER_BYTES, 0))
            # A killed run leaves its name in the file, while a status check may hold the lock.
            if (owner is not None and not owner.is_dead()) or time.monotonic() >= deadline:
                raise ObjectBusy.owned_by(object_id, owner) from error
            time.sleep(STATUS_CHECK_POLL_SECONDS)


def _path(root: Path, object_id: str, name: str) -> Path:
    return root / "objects" / object_id / name


@contextmanager
def _open(location: Location, object_id: str, name: str, mode: int = os.O_RDWR | os.O_CREAT) -> Iterator[int]:
    """Open a lock; with os.O_RDONLY also one in a store that this process may only read."""
    assert location.local is not None
    path = _path(location.local, object_id, name)
    with store_errors(location.uri, f"locking object {object_id}"):
        if mode & os.O_CREAT:
            path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, mode | os.O_CLOEXEC, 0o666)
    try:
        yield handle
    finally:
        os.close(handle)
