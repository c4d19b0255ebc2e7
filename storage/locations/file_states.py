"""What tells whether files may have the same content before they are read: size, last change, some of their bytes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import obstore

from glint.storage.errors import InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import MISSING_REMEDY
from glint.storage.locations.location import Location


@dataclass(frozen=True, slots=True)
class FileState:
    """size: in bytes; change: time of modification in nanoseconds or, in an object store, entity tag."""

    size: int
    change: str


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
                listed[folder.child(name)] = FileState(meta["size"], meta["e_tag"] or meta["last_modified"].isoformat())
    return [_remote_state(file, listed) if file.local is None else _local_state(file.local) for file in files]


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


def _remote_state(file: Location, listed: dict[Location, FileState]) -> FileState:
    if file not in listed:
        raise InputError(f"{file.uri} does not exist", MISSING_REMEDY)
    return listed[file]


def _local_state(path: Path) -> FileState:
    try:
        status = path.stat()
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist", MISSING_REMEDY) from error
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})", "check its permissions") from error
    return FileState(status.st_size, str(status.st_mtime_ns))
