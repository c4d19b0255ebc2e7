"""Meshes and pictures, named by their content: STORE/blobs/sha256/<two digits>/<sha256>.

A blob is written before the commit that names it and never changed, so a reader of a version finds what it names.
"""

import fcntl
import hashlib
import re
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import obstore

from glint.storage.errors import StoreError
from glint.storage.fsync import flush
from glint.storage.locations.conditional_writes import create
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

_RENEW = timedelta(minutes=10)


@dataclass(frozen=True, slots=True)
class BlobReference:
    """Where a blob is (`key`, from the store's root), what its bytes must be, and their media type."""

    key: str
    sha256: str
    size: int
    media_type: str


def put(location: Location, data: bytes, media_type: str) -> BlobReference:
    """Store `data`; storing the same bytes again, or from two processes at once, is harmless.

    Raises:
        StoreError: the store cannot be written.
    """
    digest = hashlib.sha256(data).hexdigest()
    reference = BlobReference(_key(digest), digest, len(data), media_type)
    with store_errors(location.uri, f"writing a blob of {len(data):,} bytes"):
        store = location.obstore()
        with _storing(location):
            if not create(store, reference.key, data):
                found = obstore.head(store, reference.key)
                # Storing again renews an old blob, which else might be collected before it is named.
                if found["size"] != len(data) or datetime.now(UTC) - found["last_modified"] > _RENEW:
                    obstore.put(store, reference.key, data, use_multipart=False)
            if location.local is not None:
                flush(location.local / reference.key)
                flush((location.local / reference.key).parent)
    return reference


def get(location: Location, reference: BlobReference) -> bytes:
    """The blob's bytes, verified.

    Raises:
        StoreError: it is missing, or its bytes are not those that were stored.
    """
    with store_errors(location.uri, f"reading blob {reference.sha256[:12]}"):
        try:
            data = bytes(obstore.get(location.obstore(), _checked_key(reference)).bytes())
        except FileNotFoundError as error:
            raise StoreError(f"blob {reference.key} is missing from {location.uri}", _LOST) from error
    if len(data) != reference.size or hashlib.sha256(data).hexdigest() != reference.sha256:
        raise StoreError(f"blob {reference.key} at {location.uri} does not hold the bytes that were stored", _LOST)
    return data


def exists(location: Location, reference: BlobReference) -> bool:
    """Whether the blob is there with its size."""
    with store_errors(location.uri, f"looking for blob {reference.sha256[:12]}"):
        try:
            return bool(obstore.head(location.obstore(), _checked_key(reference))["size"] == reference.size)
        except FileNotFoundError:
            return False


@contextmanager
def deleting(location: Location) -> Iterator[None]:
    """While blobs are deleted nobody of this machine stores one; in an object store the moment is short."""
    with _locked(location, fcntl.LOCK_EX):
        yield


def _storing(location: Location) -> AbstractContextManager[None]:
    return _locked(location, fcntl.LOCK_SH)


@contextmanager
def _locked(location: Location, kind: int) -> Iterator[None]:
    if location.local is None:
        yield
        return
    path = location.local / "blobs" / "lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as handle:
        fcntl.flock(handle, kind)
        yield


_LOST = "restore the store's blobs from a backup, or delete the file and run the object again"


def _key(digest: str) -> str:
    return f"blobs/sha256/{digest[:2]}/{digest}"


def _checked_key(reference: BlobReference) -> str:
    """The reference's key, unless what was read from the store names another place than its digest does."""
    if not re.fullmatch(r"[0-9a-f]{64}", reference.sha256) or reference.key != _key(reference.sha256):
        raise StoreError(f"blob reference {reference.key!r} does not follow from its digest", _LOST)
    return reference.key
