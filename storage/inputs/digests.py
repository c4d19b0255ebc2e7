"""Digests of inputs by their content, cached by path, size and time of change."""

import hashlib
import json
import posixpath
import time
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any

import obstore

from glint.storage.errors import InputError
from glint.storage.footage.copies import image_files
from glint.storage.footage.images import SUFFIXES
from glint.storage.inputs.heads import SINGLE_FILES, check_head
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.file_states import file_stamp
from glint.storage.locations.input_files import Address, expand, locate
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import within_time
from glint.storage.seals import digest_of

_READ_BYTES = 1 << 22
READING_PROGRESS: ContextVar[Callable[[str, int, int], None]] = ContextVar(
    "glint_reading_progress", default=lambda uri, done, total: None
)
"""Called with an input's address, the bytes read and all its bytes, while its digest is computed."""
_RECENT_NS = 100_000_000
"""Age of a change, in nanoseconds, below which another change may get the same time: ten of the largest steps in which
file systems record times."""


def content_digest(address: Address, store: Location, rehash: bool = False, key: str = "") -> str:
    """Return the SHA-256 (hex) of a file's bytes, or of names and bytes of a folder's or pattern's files.

    Names count from the files' common folder: they give the order in which the files are read. Only a folder's images
    count, and which of them are copies, since those are no frames. A file whose path, size and time of change (in an
    object store: entity tag) are those of an earlier call is not read again, unless `rehash`. Digests are cached under
    STORE/digests/.

    key: the catalogue's key that names the files; before they are read, their heads are checked, see `check_head`.

    Raises:
        InputError: missing or unreadable, not of the key's kind, on a mount that hangs, or it changed while it was
            read.
    """
    location = locate(address)
    images = None if key in SINGLE_FILES else image_files(location)
    chosen, copies = ([location], ()) if images is None else (images.listed, images.skipped)
    stamps = within_time(lambda step: _stamps(chosen, step), location.uri)
    cache = store.child("digests")
    entry = digest_of([images is None, *(file.uri for file in chosen), *copies]) + ".json"
    cached = None if rehash else _lookup(cache, entry, stamps)
    if cached is not None:
        return cached
    sizes = [int(stamp[0]) for stamp in stamps]
    if key:
        within_time(lambda step: check_head(key, chosen, sizes, images is not None), location.uri)
    digests = within_time(lambda step: _sha256_of_all(chosen, location.uri, sum(sizes), step), location.uri)
    digest = digests[0] if images is None else digest_of(sorted(zip(_names(chosen), digests, strict=True)))
    if copies:
        # Frames that were stored with the copies are other ones.
        digest = digest_of([digest, "without copies", *copies])
    if within_time(lambda step: _stamps(chosen, step), location.uri) != stamps:
        raise InputError(f"{location.uri} changed while it was read", "run again once it is written completely")
    if any(_is_recently_modified(stamp) for stamp in stamps):
        return digest
    record = json.dumps({"address": location.uri, "stamps": stamps, "digest": digest}).encode()
    with store_errors(cache.uri, "caching a digest"):
        obstore.put(cache.obstore(), entry, record, use_multipart=False)
    return digest


def input_stamps(address: Address) -> list[list[Any]]:
    """Return address and stamp of a file, or of a folder's or pattern's files: other values if one of them changes.

    Raises:
        InputError: missing or unreadable.
    """
    location = locate(address)
    files = expand(location, SUFFIXES)
    return [[file.uri, *file_stamp(file)] for file in ([location] if files is None else files)]


def _names(files: Sequence[Location]) -> list[str]:
    """Return the files' paths from the folder that contains all of them, which may be moved."""
    folder = posixpath.commonpath([file.parent.path for file in files])
    return [file.path.removeprefix(folder).lstrip("/") for file in files]


def exists(file: Location) -> bool:
    """Return whether a file exists.

    Raises:
        StoreError: the object store cannot be read.
    """
    if file.local is not None:
        return file.local.exists()
    try:
        return bool(file_stamp(file))
    except InputError:
        return False


def _is_recently_modified(stamp: list[Any]) -> bool:
    """Return whether a local file changed so recently that a further change could leave its size and times as is."""
    return isinstance(stamp[1], int) and abs(time.time_ns() - max(stamp[1:3])) < _RECENT_NS


def _lookup(cache: Location, key: str, stamps: list[list[Any]]) -> str | None:
    """Return the cached digest, None if there is none for these stamps."""
    with store_errors(cache.uri, "looking up a digest"):
        try:
            record = json.loads(bytes(obstore.get(cache.obstore(), key).bytes()))
        except (FileNotFoundError, ValueError):
            return None
    if not isinstance(record, dict) or record.get("stamps") != stamps or not isinstance(record.get("digest"), str):
        return None
    return str(record["digest"])


def _stamps(files: Sequence[Location], step: Callable[[], None]) -> list[list[Any]]:
    stamps = []
    for file in files:
        stamps.append(file_stamp(file))
        step()
    return stamps


def _sha256_of_all(files: Sequence[Location], uri: str, total: int, step: Callable[[], None]) -> list[str]:
    """Return the files' digests; `total`: their bytes together, for the progress of `uri`; `step`: after each block."""
    done, show = 0, READING_PROGRESS.get()

    def count(size: int) -> None:
        nonlocal done
        done += size
        step()
        show(uri, done, total)

    return [_sha256(file, count) for file in files]


def _sha256(file: Location, count: Callable[[int], None]) -> str:
    digest = hashlib.sha256()
    try:
        for block in _blocks(file):
            digest.update(block)
            count(len(block))
    except OSError as error:
        raise InputError(
            f"{file.uri} cannot be read ({error.strerror})", "check the file and its permissions"
        ) from error
    return digest.hexdigest()


def _blocks(file: Location) -> Iterator[Any]:
    """Yield a file's bytes block by block."""
    if file.local is None:
        with store_errors(file.uri, "reading an input"):
            yield from obstore.get(file.parent.obstore(), file.name).stream(min_chunk_size=_READ_BYTES)
        return
    with file.local.open("rb", buffering=0) as stream:
        while block := stream.read(_READ_BYTES):
            yield block
