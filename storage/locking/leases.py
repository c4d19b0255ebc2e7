"""A run's claim on an object in an object store, where no operating system ends it with the process.

The lease is one small object that its holder writes anew three times per term. Whoever finds it older than a term by
the store's own clock, or held by a dead process of the same machine, takes it over. A holder that was stopped for more
than a term may meet a second run: both then do the same work, and conditional writes keep every commit.
"""

import threading
import time
from collections.abc import Callable, Iterator
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
from glint.storage.locking.owner import Holder, ObjectBusy

if TYPE_CHECKING:
    from obstore import GetResult

TERM = timedelta(minutes=3)


@contextmanager
def lease(
    location: Location,
    object_id: str,
    run: str = "",
    wait_seconds: float = 0.0,
    on_wait: Callable[[Holder], None] | None = None,
    term: timedelta = TERM,
) -> Iterator[None]:
    """Hold the object's lease; another holder is waited for up to `wait_seconds` (`on_wait` is told once who it is).

    Raises:
        ObjectBusy: it did not end in time.
    """
    store, key = location.obstore(), _key(object_id)
    mine, deadline, told = Holder.this_process(run), time.monotonic() + wait_seconds, False
    with store_errors(location.uri, f"claiming object {object_id}"):
        while (holder := _claim(store, key, mine, term)) is not None:
            if time.monotonic() >= deadline:
                raise ObjectBusy.by(object_id, holder)
            if on_wait is not None and not told:
                on_wait(holder)
                told = True
            time.sleep(min(1.0, term.total_seconds() / 10))
    ended = threading.Event()
    renewal = threading.Thread(target=_renew, args=(store, key, mine, term, ended), daemon=True)
    renewal.start()
    try:
        yield
    finally:
        ended.set()
        renewal.join()
        with store_errors(location.uri, f"releasing object {object_id}"):
            _release(store, key, mine)


def lease_holder(location: Location, object_id: str, term: timedelta = TERM) -> Holder | None:
    """Who runs the object now, or None."""
    with store_errors(location.uri, f"asking who works on object {object_id}"):
        store = location.obstore()
        found = _read(store, _key(object_id))
        if found is None:
            return None
        holder = Holder.read(bytes(found.bytes()))
        return None if holder is None or _expired(store, found, holder, term) else holder


def _claim(store: ObjectStore, key: str, mine: Holder, term: timedelta) -> Holder | None:
    """None once the lease is ours, else who has it."""
    if create(store, key, mine.as_bytes()):
        return None
    found = _read(store, key)
    if found is None:
        return _claim(store, key, mine, term)
    holder = Holder.read(bytes(found.bytes()))
    if holder is not None and not _expired(store, found, holder, term):
        return holder
    if any(compare_and_swap(store, key, mine.as_bytes(), found.meta, quoted) for quoted in (True, False)):
        return None
    return _claim(store, key, mine, term)


def _renew(store: ObjectStore, key: str, mine: Holder, term: timedelta, ended: threading.Event) -> None:
    while not ended.wait(term.total_seconds() / 3):
        try:
            found = _read(store, key)
            if found is None or Holder.read(bytes(found.bytes())) != mine:
                return
            any(compare_and_swap(store, key, mine.as_bytes(), found.meta, quoted) for quoted in (True, False))
        except BaseError:
            continue


def _release(store: ObjectStore, key: str, mine: Holder) -> None:
    found = _read(store, key)
    if found is not None and Holder.read(bytes(found.bytes())) == mine:
        obstore.delete(store, key)


def _expired(store: ObjectStore, found: "GetResult", holder: Holder, term: timedelta) -> bool:
    """Whether the holder is dead or has not renewed for a term; the store itself tells the time of both."""
    if holder.is_dead():
        return True
    clock = f"probe/{uuid4().hex}"
    obstore.put(store, clock, b"now", use_multipart=False)
    now = obstore.head(store, clock)["last_modified"]
    obstore.delete(store, clock)
    return bool(now - found.meta["last_modified"] > term)


def _read(store: ObjectStore, key: str) -> "GetResult | None":
    try:
        return obstore.get(store, key)
    except FileNotFoundError:
        return None


def _key(object_id: str) -> str:
    return f"objects/{object_id}/run.json"
