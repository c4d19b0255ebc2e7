"""Locks beside an object's repository: around every mutation, and around a whole run of the object.

In a local store the operating system holds them on behalf of the process, so a killed process leaves none behind. In an
object store mutations need none, and a run holds a lease.
"""

import fcntl
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.locking.leases import lease, lease_holder
from glint.storage.locking.owner import Holder, ObjectBusy

_GLANCE = 1.0
"""Seconds that looking at a lock can take at the very most."""


@contextmanager
def mutation_lock(location: Location, object_id: str) -> Iterator[None]:
    """Wait for, then hold, the right to change an object's repository.

    A local file system lets two committers overwrite each other silently. Object stores refuse the second one
    themselves, so there nothing is locked.
    """
    if location.local is None:
        yield
        return
    with _open(location, object_id, "repo.lock") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@contextmanager
def run_lock(
    location: Location,
    object_id: str,
    run: str = "",
    wait_seconds: float = 0.0,
    on_wait: Callable[[Holder], None] | None = None,
) -> Iterator[None]:
    """Hold an object for one run; another run waits up to `wait_seconds` (`on_wait` is told once who holds it).

    Raises:
        ObjectBusy: the other run did not end in time.
    """
    if location.local is None:
        with lease(location, object_id, run, wait_seconds, on_wait):
            yield
        return
    with _open(location, object_id, "run.lock") as handle:
        _wait_for(handle, object_id, time.monotonic() + wait_seconds, on_wait)
        os.ftruncate(handle, 0)
        os.pwrite(handle, Holder.this_process(run).as_bytes(), 0)
        try:
            yield
        finally:
            os.ftruncate(handle, 0)


def run_holder(location: Location, object_id: str) -> Holder | None:
    """Who runs the object now, or None."""
    if location.local is None:
        return lease_holder(location, object_id)
    if not _path(location.local, object_id, "run.lock").exists():
        return None
    with _open(location, object_id, "run.lock") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return Holder.read(os.pread(handle, 4096, 0))
        return None


def _wait_for(handle: int, object_id: str, deadline: float, on_wait: Callable[[Holder], None] | None) -> None:
    """Take the lock. Whoever only looks holds it for an instant and signs no name: that is waited for in any case."""
    patience, told = time.monotonic() + _GLANCE, False
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError as error:
            holder = Holder.read(os.pread(handle, 4096, 0))
            if time.monotonic() >= (deadline if holder else max(deadline, patience)):
                raise ObjectBusy.by(object_id, holder) from error
            if on_wait is not None and holder is not None and not told:
                on_wait(holder)
                told = True
            time.sleep(0.01 if holder is None else 0.2)


def _path(root: Path, object_id: str, name: str) -> Path:
    return root / "objects" / object_id / name


@contextmanager
def _open(location: Location, object_id: str, name: str) -> Iterator[int]:
    assert location.local is not None
    path = _path(location.local, object_id, name)
    with store_errors(location.uri, f"locking object {object_id}"):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        yield handle
    finally:
        os.close(handle)
