"""Does a store keep the promises that versions rest on? Asked once, before anything is written there."""

from typing import TYPE_CHECKING
from uuid import uuid4

import obstore
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import ObjectStore

from storage.errors import StoreError
from storage.faults import store_faults

if TYPE_CHECKING:
    from obstore import PutResult, UpdateVersion

    from storage.location import Location

_REMEDY = (
    "use a store with conditional writes (If-None-Match and If-Match), such as S3, Azure or Ceph, or a local folder"
)


def probe(location: "Location") -> None:
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
    obstore.put(store, key, b"first", mode="create", use_multipart=False)
    try:
        obstore.put(store, key, b"second", mode="create", use_multipart=False)
    except AlreadyExistsError:
        pass
    else:
        raise StoreError(f"{uri} writes over what it was told to create", _REMEDY)
    if bytes(obstore.get(store, key).bytes()) != b"first":
        raise StoreError(f"{uri} does not return what was written", _REMEDY)


def _try_swap(store: ObjectStore, key: str, uri: str) -> None:
    """Some servers compare the entity tag with its quotes and some without: one must do, and neither may be ignored."""
    swapped = False
    for quoted in (True, False):
        stale = _condition(obstore.put(store, key, b"old", use_multipart=False), quoted)
        current = _condition(obstore.put(store, key, b"current", use_multipart=False), quoted)
        if _swap(store, key, stale):
            raise StoreError(f"{uri} lets a stale writer overwrite a newer one", _REMEDY)
        swapped |= _swap(store, key, current)
    if not swapped:
        raise StoreError(f"{uri} refuses a writer that has seen the newest state", _REMEDY)


def _condition(written: "PutResult", quoted: bool) -> "UpdateVersion":
    condition: UpdateVersion = {}
    if written["e_tag"]:
        condition["e_tag"] = written["e_tag"] if quoted else written["e_tag"].strip('"')
    if written["version"]:
        condition["version"] = written["version"]
    return condition


def _swap(store: ObjectStore, key: str, condition: "UpdateVersion") -> bool:
    try:
        obstore.put(store, key, b"swapped", mode=condition, use_multipart=False)
    except PreconditionError:
        return False
    return True
