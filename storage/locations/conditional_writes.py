"""Check that an object store honours conditional writes, on which versioning depends, before writing to it.

`create` writes only what is absent (If-None-Match), `compare_and_swap` replaces only a known state (If-Match).
"""

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import obstore
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import ObjectStore

from glint.storage.errors import StoreError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

if TYPE_CHECKING:
    from obstore import UpdateVersion

CONDITIONS_REMEDY = (
    "use a store with conditional writes (If-None-Match and If-Match), such as S3, Azure or Ceph, or a local folder"
)


def create(store: ObjectStore, key: str, data: bytes) -> bool:
    """Write `data` unless `key` exists; return whether it was written."""
    try:
        obstore.put(store, key, data, mode="create", use_multipart=False)
    except AlreadyExistsError:
        return False
    return True


def compare_and_swap(
    store: ObjectStore, key: str, data: bytes, expected: Mapping[str, Any], quote_tag: bool = True
) -> bool:
    """Write `data` if `key` is still in the `expected` state; return whether it was written.

    expected: the store's answer to the put or get that gave this state. quote_tag: send the entity tag in its quotes,
    as HTTP requires; Ceph's gateway compares it without.
    """
    condition: UpdateVersion = {}
    if expected["e_tag"]:
        condition["e_tag"] = expected["e_tag"] if quote_tag else expected["e_tag"].strip('"')
    if expected["version"]:
        condition["version"] = expected["version"]
    try:
        obstore.put(store, key, data, mode=condition, use_multipart=False)
    except PreconditionError:
        return False
    return True


def check_conditional_writes(location: Location) -> None:
    """Write, read, and try conditional writes that must fail; nothing is left in the store.

    On a local folder a lock replaces compare-and-swap, so only creation is tried.

    Raises:
        StoreError: the store cannot be used, or ignores a condition and would lose results silently.
    """
    with store_errors(location.uri, "writing to the store"):
        store, key = location.obstore(), f"probe/{uuid4().hex}"
        try:
            _check_create(store, key, location.uri)
            if location.local is None:
                _check_swap(store, key, location.uri)
        finally:
            # Where nothing could be written, the error of the write is the one to report.
            with suppress(FileNotFoundError):
                obstore.delete(store, key)
            if location.local is not None:
                with suppress(OSError):
                    (location.local / "probe").rmdir()


def _check_create(store: ObjectStore, key: str, uri: str) -> None:
    if not create(store, key, b"first") or bytes(obstore.get(store, key).bytes()) != b"first":
        raise StoreError(f"{uri} does not return what was written", CONDITIONS_REMEDY)
    if create(store, key, b"second"):
        raise StoreError(f"{uri} overwrites an object that it should only create", CONDITIONS_REMEDY)


def _check_swap(store: ObjectStore, key: str, uri: str) -> None:
    """Try the entity tag with and without its quotes: the server must honour one form, and may ignore neither."""
    is_swapped = False
    for quote_tag in (True, False):
        old = obstore.put(store, key, b"old", use_multipart=False)
        current = obstore.put(store, key, b"current", use_multipart=False)
        if compare_and_swap(store, key, b"lost", old, quote_tag):
            raise StoreError(f"{uri} lets a stale writer overwrite a newer state", CONDITIONS_REMEDY)
        is_swapped |= compare_and_swap(store, key, b"swapped", current, quote_tag)
    if not is_swapped:
        raise StoreError(f"{uri} refuses a writer that knows the newest state", CONDITIONS_REMEDY)
