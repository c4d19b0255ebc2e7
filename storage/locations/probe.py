"""Does a store keep the promises that versions rest on? Asked once, before anything is written there."""

from uuid import uuid4

import obstore
from obstore.store import ObjectStore

from glint.storage.errors import StoreError
from glint.storage.locations.conditional_writes import create, swap
from glint.storage.locations.error_translation import store_faults
from glint.storage.locations.location import Location

_REMEDY = (
    "use a store with conditional writes (If-None-Match and If-Match), such as S3, Azure or Ceph, or a local folder"
)


def probe(location: Location) -> None:
    """Write, read, and try two conditional writes that must fail; leaves nothing behind.

    On a local folder a lock does what compare-and-swap does on an object store, so only creation is tried there.

    Raises:
        StoreError: the store cannot be used, or ignores a condition and would lose results silently.
    """
    with store_faults(location.uri, "trying the store"):
        store, key = location.obstore(), f"probe/{uuid4().hex}"
        try:
            _try_create(store, key, location.uri)
            if location.local is None:
                _try_swap(store, key, location.uri)
        finally:
            obstore.delete(store, key)


def _try_create(store: ObjectStore, key: str, uri: str) -> None:
    if not create(store, key, b"first") or bytes(obstore.get(store, key).bytes()) != b"first":
        raise StoreError(f"{uri} does not return what was written", _REMEDY)
    if create(store, key, b"second"):
        raise StoreError(f"{uri} writes over what it was told to create", _REMEDY)


def _try_swap(store: ObjectStore, key: str, uri: str) -> None:
    """Some servers compare the entity tag with its quotes and some without: one must do, and neither may be ignored."""
    swapped = False
    for quoted in (True, False):
        old = obstore.put(store, key, b"old", use_multipart=False)
        current = obstore.put(store, key, b"current", use_multipart=False)
        if swap(store, key, b"lost", old, quoted):
            raise StoreError(f"{uri} lets a stale writer overwrite a newer one", _REMEDY)
        swapped |= swap(store, key, b"swapped", current, quoted)
    if not swapped:
        raise StoreError(f"{uri} refuses a writer that has seen the newest state", _REMEDY)
