"""Leases: locks of objects in an object store, where the operating system cannot release a lock when its owner ends.

A lease is one small object, which its owner rewrites three times per term. If it is older than a term by the store's
clock, or its owner is a dead process of this machine, another run takes it over. An owner that was suspended for more
than a term may therefore run beside a second one: both then do the same work, and conditional writes protect commits.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING
from uuid import uuid4

import obstore
from obstore.exceptions import BaseError
from obstore.store import ObjectStore

from glint.storage.locations.conditional_writes import compare_and_swap, create
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.locking.owner import LockOwner, ObjectBusy

if TYPE_CHECKING:
    from obstore import GetResult

LEASE_TERM = timedelta(minutes=3)
"""Time without a renewal after which a lease may be taken over."""
RENEWALS_PER_TERM = 3
"""Renewals in a term: two may fail before the lease expires."""


@contextmanager
def lease(location: Location, object_id: str, run: str = "", term: timedelta = LEASE_TERM) -> Iterator[None]:
    """Hold the object's lease, and renew it in a thread.

    Raises:
        ObjectBusy: another run holds it.
    """
    store, key, owner = location.obstore(), _key(object_id), LockOwner.this_process(run)
    with store_errors(location.uri, f"claiming object {object_id}"):
        other_owner = _claim(store, key, owner, term)
    if other_owner is not None:
        raise ObjectBusy.owned_by(object_id, other_owner)
    released = threading.Event()
    renewal = threading.Thread(target=_renew, args=(store, key, owner, term, released), daemon=True)
    renewal.start()
    try:
        yield
    finally:
        released.set()
        renewal.join()
        with store_errors(location.uri, f"releasing object {object_id}"):
            _release(store, key, owner)


def lease_owner(location: Location, object_id: str) -> LockOwner | None:
    """Return the owner of the object's lease, or None if it is free, expired or its owner is dead."""
    with store_errors(location.uri, f"reading the lease of object {object_id}"):
        store = location.obstore()
        stored = _read(store, _key(object_id))
        if stored is None:
            return None
        owner = LockOwner.from_bytes(bytes(stored.bytes()))
        return None if owner is None or _is_expired(store, stored, owner, LEASE_TERM) else owner


def _claim(store: ObjectStore, key: str, owner: LockOwner, term: timedelta) -> LockOwner | None:
    """Take the lease for `owner`; return None, or the present owner if it is held."""
    if create(store, key, owner.as_bytes()):
        return None
    stored = _read(store, key)
    if stored is None:
        # It was released since; try again.
        return _claim(store, key, owner, term)
    present_owner = LockOwner.from_bytes(bytes(stored.bytes()))
    if present_owner is not None and not _is_expired(store, stored, present_owner, term):
        return present_owner
    if _overwrite(store, key, owner, stored):
        return None
    # Another run took over the expired lease first.
    return _claim(store, key, owner, term)


def _renew(store: ObjectStore, key: str, owner: LockOwner, term: timedelta, released: threading.Event) -> None:
    while not released.wait(term.total_seconds() / RENEWALS_PER_TERM):
        try:
            stored = _read(store, key)
            if stored is None or LockOwner.from_bytes(bytes(stored.bytes())) != owner:
                return
            _overwrite(store, key, owner, stored)
        except BaseError:
            continue


def _release(store: ObjectStore, key: str, owner: LockOwner) -> None:
    stored = _read(store, key)
    if stored is not None and LockOwner.from_bytes(bytes(stored.bytes())) == owner:
        obstore.delete(store, key)


def _overwrite(store: ObjectStore, key: str, owner: LockOwner, stored: "GetResult") -> bool:
    """Replace the lease that was read as `stored`; return False if it has changed since."""
    # Ceph's gateway compares entity tags without their quotes.
    return any(compare_and_swap(store, key, owner.as_bytes(), stored.meta, quoted) for quoted in (True, False))


def _is_expired(store: ObjectStore, stored: "GetResult", owner: LockOwner, term: timedelta) -> bool:
    """Return whether the owner is dead or its lease has expired, by the store's clock."""
    if owner.is_dead():
        return True
    clock = f"probe/{uuid4().hex}"
    obstore.put(store, clock, b"now", use_multipart=False)
    now = obstore.head(store, clock)["last_modified"]
    obstore.delete(store, clock)
    return bool(now - stored.meta["last_modified"] > term)


def _read(store: ObjectStore, key: str) -> "GetResult | None":
    try:
        return obstore.get(store, key)
    except FileNotFoundError:
        return None


def _key(object_id: str) -> str:
    return f"objects/{object_id}/run.json"
