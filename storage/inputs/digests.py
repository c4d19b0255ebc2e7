"""Digests of inputs by their content, remembered by path, size and time of change; digests of parameters."""

import hashlib
import json
import time
from collections.abc import Collection
from typing import Any

import obstore

from glint.storage.errors import InputError
from glint.storage.footage.images import SUFFIXES
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import MISSING, Address, expand, locate
from glint.storage.locations.location import Location

_BLOCK = 1 << 22
_TICK = 100_000_000
"""Nanoseconds; file systems tell times in steps of up to 10 ms."""


def digest_of(value: Any) -> str:
    """SHA-256 (hex) of a value of JSON, by its content: the order of keys does not matter.

    Raises:
        ValueError: NaN or infinity; TypeError: something that JSON has not.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def content_digest(
    address: Address, store: Location, rehash: bool = False, suffixes: Collection[str] = SUFFIXES
) -> str:
    """SHA-256 (hex) of a file's bytes, or of names and bytes of a folder's or pattern's files with these suffixes.

    A file whose path, size and time of change (in an object store its entity tag) were seen before is not read again,
    unless `rehash`. What was seen is kept under STORE/digests/.

    Raises:
        InputError: nothing is there, or it cannot be read.
    """
    location = locate(address)
    files = expand(location, suffixes)
    chosen = [location] if files is None else files
    marks = [mark(file) for file in chosen]
    memory = store.child("digests")
    key = digest_of([files is None, *(file.uri for file in chosen)]) + ".json"
    known = None if rehash else _recall(memory, key, marks)
    if known is not None:
        return known
    each = [_sha256(file) for file in chosen]
    digest = each[0] if files is None else digest_of(sorted(zip((f.name for f in chosen), each, strict=True)))
    if [mark(file) for file in chosen] != marks:
        raise InputError(f"{location.uri} changed while it was read", "run again when it is written to no more")
    if any(_is_fresh(each) for each in marks):
        return digest
    record = json.dumps({"address": location.uri, "marks": marks, "digest": digest}).encode()
    with store_errors(memory.uri, "remembering a digest"):
        obstore.put(memory.obstore(), key, record, use_multipart=False)
    return digest


def mark(file: Location) -> list[Any]:
    """What changes whenever a file's content does, without reading it: size and times, or size and entity tag.

    Raises:
        InputError: it is not there, or cannot be read; StoreError: the object store cannot.
    """
    try:
        if file.local is not None:
            status = file.local.stat()
            return [status.st_size, status.st_mtime_ns, status.st_ctime_ns]
        with store_errors(file.uri, "looking at an input"):
            try:
                found = obstore.head(file.parent.obstore(), file.name)
            except FileNotFoundError as error:
                raise InputError(f"{file.uri} does not exist", MISSING) from error
            return [found["size"], found["e_tag"] or found["last_modified"].isoformat()]
    except FileNotFoundError as error:
        raise InputError(f"{file.uri} does not exist", MISSING) from error
    except OSError as error:
        raise InputError(f"{file.uri} cannot be read ({error.strerror})", "check its permissions") from error


def exists(file: Location) -> bool:
    """Whether a file is there.

    Raises:
        StoreError: the object store cannot be asked.
    """
    if file.local is not None:
        return file.local.exists()
    try:
        return bool(mark(file))
    except InputError:
        return False


def _is_fresh(mark: list[Any]) -> bool:
    """Whether a local file changed so lately that a further change could leave size and time as they are."""
    return isinstance(mark[1], int) and abs(time.time_ns() - max(mark[1:])) < _TICK


def _recall(memory: Location, key: str, marks: list[list[Any]]) -> str | None:
    with store_errors(memory.uri, "looking up a digest"):
        try:
            record = json.loads(bytes(obstore.get(memory.obstore(), key).bytes()))
        except (FileNotFoundError, ValueError):
            return None
    if not isinstance(record, dict) or record.get("marks") != marks or not isinstance(record.get("digest"), str):
        return None
    return str(record["digest"])


def _sha256(file: Location) -> str:
    digest = hashlib.sha256()
    try:
        if file.local is not None:
            with file.local.open("rb") as stream:
                return hashlib.file_digest(stream, "sha256").hexdigest()
        with store_errors(file.uri, "reading an input"):
            for block in obstore.get(file.parent.obstore(), file.name).stream(min_chunk_size=_BLOCK):
                digest.update(block)
    except OSError as error:
        raise InputError(
            f"{file.uri} cannot be read ({error.strerror})", "check the file and its permissions"
        ) from error
    return digest.hexdigest()
