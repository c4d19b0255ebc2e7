"""Does a store keep the promises that versions rest on? Asked once, before anything is written there."""

from typing import TYPE_CHECKING
from uuid import uuid4

import obstore
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import ObjectStore

from storage.errors import StoreError
from storage.faults import store_faults

if TYPE_CHECKING:
    from obstore import UpdateVersion

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
    """Some servers compare the entity tag with its quotes and some without: either will do, ignoring it will not."""
    for quoted in (True, False):
        old = obstore.put(store, key, b"old", use_multipart=False)
        tag, version = old["e_tag"] or "", old["version"]
        stale: "UpdateVersion" = {"e_tag": tag if quoted else tag.strip('"'), "version": version}
        obstore.put(store, key, b"current", use_multipart=False)
        try:
            obstore.put(store, key, b"lost", mode=stale, use_multipart=False)
        except PreconditionError:
            continue
        raise StoreError(f"{uri} lets a stale writer overwrite a newer one", _REMEDY)
