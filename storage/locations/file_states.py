"""What tells, before files are read, whether one has changed or two may be alike: size, last change, some bytes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import obstore

from glint.storage.errors import InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import MISSING_REMEDY
from glint.storage.locations.location import Location


@dataclass(frozen=True, slots=True)
class FileState:
    """size: in bytes; change: what changes with the content, see `file_stamp`."""

    size: int
    change: str


def file_stamp(file: Location) -> list[Any]:
    """Return values that change whenever a file's content does, without reading it.

    These are size, time of modification and time of change (nanoseconds) and the file's number on its disk; in an
    object store size and entity tag.

    Raises:
        InputError: missing or unreadable; StoreError: the object store cannot be read.
    """
    try:
        if file.local is not None:
            status = file.local.stat()
            return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
        with store_errors(file.uri, "looking at an input"):
            try:
                meta = obstore.head(file.parent.obstore(), file.name)
            except FileNotFoundError as error:
                raise InputError(f"{file.uri} does not exist", MISSING_REMEDY) from error
            return _remote_stamp(meta)
    except FileNotFoundError as error:
        raise InputError(f"{file.uri} does not exist", MISSING_REMEDY) from error
    except OSError as error:
        raise InputError(f"{file.uri} cannot be read ({error.strerror})", "check its permissions") from error


def file_states(files: Sequence[Location]) -> list[FileState]:
    """Return the states of files; each prefix of an object store is listed once.

    Raises:
        InputError: missing or unreadable; StoreError: the object store cannot be read.
    """
    listed = dict[Location, FileState]()
    for folder in {file.parent for file in files if file.local is None}:
        with store_errors(folder.uri, "listing an input"):
            for meta in obstore.list_with_delimiter(folder.obstore())["objects"]:
                name = meta["path"].rpartition("/")[2]
                listed[folder.child(name)] = _state(_remote_stamp(meta))
    return [listed.get(file) or _state(file_stamp(file)) for file in files]


def read_part(file: Location, start: int, length: int) -> bytes:
    """Read some bytes of a file; fewer where it ends.

    Raises:
        InputError: missing or unreadable; StoreError: the object store cannot be read.
    """
    if file.local is None:
        with store_errors(file.uri, "reading an input"):
            return bytes(obstore.get_range(file.parent.obstore(), file.name, start=start, length=length))
    try:
        with file.local.open("rb") as stream:
            stream.seek(start)
            return stream.read(length)
    except OSError as error:
        raise InputError(f"{file.uri} cannot be read ({error.strerror})", "check its permissions") from error


def _remote_stamp(meta: Mapping[str, Any]) -> list[Any]:
    return [meta["size"], meta["e_tag"] or meta["last_modified"].isoformat()]


def _state(stamp: list[Any]) -> FileState:
    size, *change = stamp
    return FileState(size, str(change))
