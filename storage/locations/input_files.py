"""List and read input files: a file, the files of a folder, or those that match a pattern, in natural order."""

import fnmatch
import glob
import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import obstore

from glint.storage.errors import InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import within_time

Address = str | Path | Location
"""A path, an address of an object store, or a location."""

MISSING_REMEDY = "check the path; relative paths count from the catalogue's folder"

MAX_TEXT_BYTES = 32_000_000
"""Size of the largest text file that is read beside the frames."""
_MAX_KINDS = 2
"""Kinds of files that are named where there are no images."""
HEAD_BYTES = 512
"""Bytes of a file that show whether it is text."""


def locate(address: Address) -> Location:
    """Return the location of an address."""
    return address if isinstance(address, Location) else Location.parse(address)


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key by which img_2 comes before img_10."""
    parts = re.split(r"(\d+)", name, flags=re.ASCII)
    return tuple((0, int(part), "") if part.isdigit() and part.isascii() else (1, 0, part) for part in parts)


def expand(location: Location, suffixes: Collection[str]) -> list[Location] | None:
    """List the files of a folder (with one of the suffixes) or of a pattern, in natural order; None for a single file.

    Raises:
        InputError: no such file or folder, or no file in it.
    """
    path = location.local
    if path is not None:
        files = within_time(lambda step: _expand_local(path, suffixes, step), location.uri)
    else:
        files = _expand_remote(location, suffixes)
    if files is None:
        return None
    if not files:
        remedy = f"the folder or pattern must contain files that end in {', '.join(sorted(suffixes))}"
        raise InputError(
            f"no images at {location.uri}{_other_files(location)}", f"{remedy}; convert others, and name a video itself"
        )
    return sorted(files, key=lambda file: (natural_key(file.path), file.path))


def _other_files(location: Location) -> str:
    """Return in words what a local folder, or that of a pattern, holds instead of images; empty: nothing."""
    kinds = Counter[str]()
    with suppress(OSError):
        folder = location.local or Path(os.devnull)
        for file in (folder if folder.is_dir() else folder.parent).iterdir():
            if not file.name.startswith(".") and not file.is_dir():
                kinds[f"{file.suffix.lower()} file" if file.exists() else "link that leads nowhere"] += 1
    listed = [
        f"{count} {kind if count == 1 else kind.replace('file', 'files').replace('link that leads', 'links that lead')}"
        for kind, count in kinds.most_common(_MAX_KINDS)
        if kind != " file"
    ]
    return f", but {' and '.join(listed)}" if listed else ""


def list_folder(location: Location) -> tuple[list[Location], list[Location]]:
    """List the folders and the files directly in a folder or prefix, without hidden ones, both in natural order.

    Raises:
        InputError: the folder cannot be read; StoreError: the object store cannot.
    """
    if location.local is not None:
        try:
            paths = list(location.local.iterdir())
            folders = [Location("file", "", str(path)) for path in paths if path.is_dir()]
            files = [Location("file", "", str(path)) for path in paths if path.is_file()]
        except OSError as error:
            raise InputError(
                f"{location.uri} cannot be read ({error.strerror})", "check the path and its permissions"
            ) from error
    else:
        with store_errors(location.uri, "listing an input"):
            listing = obstore.list_with_delimiter(location.obstore())
        folders = [location.child(_last_part(prefix)) for prefix in listing["common_prefixes"]]
        files = [location.child(_last_part(meta["path"])) for meta in listing["objects"]]
    return _visible(folders), _visible(files)


def _visible(entries: list[Location]) -> list[Location]:
    visible = [entry for entry in entries if not entry.name.startswith(".")]
    return sorted(visible, key=lambda entry: (natural_key(entry.name), entry.name))


def _last_part(path: str) -> str:
    return path.strip("/").rpartition("/")[2]


def read_bytes(location: Location, limit: int) -> bytes:
    """Read a file.

    Raises:
        InputError: missing, unreadable, no plain file, larger than `limit` bytes, or on a mount that hangs.
    """
    path = location.local
    try:
        if path is None:
            size, data = _remote_bytes(location, limit)
        else:
            size, data = within_time(lambda step: _local_bytes(path, limit), location.uri)
    except FileNotFoundError as error:
        raise InputError(f"{location.uri} does not exist", MISSING_REMEDY) from error
    except OSError as error:
        raise InputError(f"{location.uri} cannot be read ({error.strerror})", "check its permissions") from error
    if data is None:
        raise InputError(f"{location.uri} has {size:,} bytes, more than {limit:,}", "check that it is the right file")
    return data


def _local_bytes(path: Path, limit: int) -> tuple[int, bytes | None]:
    check_plain_file(path)
    size = path.stat().st_size
    if size > limit:
        return size, None
    with path.open("rb") as file:
        return size, file.read(size)


def check_plain_file(path: Path) -> None:
    """Refuse what is no file on a disk: reading a pipe or a device may never end, and /proc shows other programs.

    Raises:
        InputError: a folder, pipe, socket or device, or a file of the system's own; OSError: missing or unreadable.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path} is not a file", "give the path of a file")
    if status.st_dev in _system_devices():
        raise InputError(f"{path} belongs to the system and is not an input", "give the path of a file on a disk")


@lru_cache(maxsize=1)
def _system_devices() -> frozenset[int]:
    """Return the device numbers of the file systems that the kernel invents."""
    return frozenset(folder.stat().st_dev for folder in (Path("/proc"), Path("/sys")) if folder.is_dir())


ARCHIVE_HEADS = (b"PK\x03\x04", b"7z\xbc\xaf\x27\x1c", b"Rar!\x1a\x07", b"\x1f\x8b")
"""First bytes of ZIP, 7z, RAR and gzip files."""


def plain_kind(location: Location) -> str:
    """Return in words that a local file is empty, text or an archive; "": none of them, or in an object store."""
    head: bytes | None = None
    if location.local is not None:
        with suppress(OSError), location.local.open("rb") as file:
            head = file.read(HEAD_BYTES)
    if head is None:
        return ""
    if not head:
        return "empty (0 bytes)"
    if head.startswith(ARCHIVE_HEADS):
        return "an archive"
    text = head.decode("utf-8", "ignore")
    # A character may be cut at the end.
    is_text = len(text.encode()) > len(head) - 4 and all(letter.isprintable() or letter.isspace() for letter in text)
    return "a text file" if is_text else ""


def _remote_bytes(location: Location, limit: int) -> tuple[int, bytes | None]:
    with store_errors(location.uri, "reading an input"):
        store = location.parent.obstore()
        try:
            size = obstore.head(store, location.name)["size"]
            return size, bytes(obstore.get(store, location.name).bytes()) if size <= limit else None
        except FileNotFoundError as error:
            raise InputError(f"{location.uri} does not exist", MISSING_REMEDY) from error


def is_pattern(text: str) -> bool:
    """Return whether a path contains wildcards."""
    return any(wildcard in text for wildcard in "*?[")


def _expand_local(path: Path, suffixes: Collection[str], step: Callable[[], None]) -> list[Location] | None:
    """List as `expand` does; `step` is called after every file."""

    def is_file(file: Path) -> bool:
        step()
        return file.is_file()

    try:
        if path.is_dir():
            files = (
                file for file in path.iterdir() if file.suffix.lower() in suffixes and not file.name.startswith(".")
            )
            return [Location("file", "", str(file)) for file in files if is_file(file)]
        if path.is_file():
            check_plain_file(path)
            return None
        if path.exists():
            raise InputError(f"{path} is neither a file nor a folder", MISSING_REMEDY)
        if is_pattern(str(path)):
            return [Location("file", "", file) for file in glob.iglob(str(path)) if is_file(Path(file))]  # noqa: PTH207
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})", "check the path and its permissions") from error
    raise InputError(f"{path} does not exist", MISSING_REMEDY)


def _expand_remote(location: Location, suffixes: Collection[str]) -> list[Location] | None:
    pattern = location.name if is_pattern(location.name) else None
    folder = location.parent if pattern else location
    with store_errors(location.uri, "listing an input"):
        # A date with dots is a folder's name: the suffix of a file has a letter.
        if pattern is None and re.search(r"\.[^.]*[A-Za-z][^.]*$", location.name):
            return None
        objects = obstore.list_with_delimiter(folder.obstore())["objects"]
    names = [_last_part(meta["path"]) for meta in objects]
    if pattern is None:
        return [folder.child(name) for name in names if Path(name).suffix.lower() in suffixes]
    return [folder.child(name) for name in names if fnmatch.fnmatchcase(name, pattern)]
