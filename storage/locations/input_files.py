"""The files that an input address stands for: itself, a folder's, or those that match a pattern; in natural order."""

import fnmatch
import glob
import re
from collections.abc import Collection
from pathlib import Path

import obstore

from glint.storage.errors import InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

Address = str | Path | Location
"""A path, an address of an object store, or a place."""

MISSING = "check the path; relative ones count from the catalogue's folder"

MAX_TEXT = 32_000_000
"""Bytes of a text file that is read beside the frames."""


def locate(address: Address) -> Location:
    """The place of an address."""
    return address if isinstance(address, Location) else Location.parse(address)


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key by which img_2 comes before img_10."""
    parts = re.split(r"(\d+)", name, flags=re.ASCII)
    return tuple((0, int(part), "") if part.isdigit() and part.isascii() else (1, 0, part) for part in parts)


def expand(location: Location, suffixes: Collection[str]) -> list[Location] | None:
    """Files of a folder (those with one of the suffixes) or of a pattern, in natural order; None for a single file.

    Raises:
        InputError: nothing is there.
    """
    if location.local is not None:
        files = _local(location.local, suffixes)
    else:
        files = _remote(location, suffixes)
    if files is None:
        return None
    if not files:
        raise InputError(
            f"no images at {location.uri}", f"the folder or pattern must give files like {', '.join(sorted(suffixes))}"
        )
    return sorted(files, key=lambda file: (natural_key(file.path), file.path))


def entries(place: Location) -> tuple[list[Location], list[Location]]:
    """Folders and files directly in a folder or prefix, hidden ones left out, each in natural order.

    Raises:
        InputError: the folder cannot be read; StoreError: the object store cannot.
    """
    if place.local is not None:
        try:
            paths = list(place.local.iterdir())
            folders = [Location("file", "", str(path)) for path in paths if path.is_dir()]
            files = [Location("file", "", str(path)) for path in paths if path.is_file()]
        except OSError as error:
            raise InputError(
                f"{place.uri} cannot be read ({error.strerror})", "check the path and its permissions"
            ) from error
    else:
        with store_errors(place.uri, "listing an input"):
            found = obstore.list_with_delimiter(place.obstore())
        folders = [place.child(_last(prefix)) for prefix in found["common_prefixes"]]
        files = [place.child(_last(entry["path"])) for entry in found["objects"]]
    return _visible(folders), _visible(files)


def _visible(places: list[Location]) -> list[Location]:
    shown = [place for place in places if not place.name.startswith(".")]
    return sorted(shown, key=lambda place: (natural_key(place.name), place.name))


def _last(path: str) -> str:
    return path.strip("/").rpartition("/")[2]


def read_bytes(location: Location, limit: int) -> bytes:
    """A file's bytes.

    Raises:
        InputError: missing, unreadable, or larger than `limit` bytes.
    """
    try:
        size, data = _local_bytes(location.local, limit) if location.local else _remote_bytes(location, limit)
    except FileNotFoundError as error:
        raise InputError(f"{location.uri} does not exist", MISSING) from error
    except OSError as error:
        raise InputError(f"{location.uri} cannot be read ({error.strerror})", "check its permissions") from error
    if data is None:
        raise InputError(f"{location.uri} has {size:,} bytes, more than {limit:,}", "check that it is the right file")
    return data


def _local_bytes(path: Path, limit: int) -> tuple[int, bytes | None]:
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is not a file", "name a file")
    size = path.stat().st_size
    return size, path.read_bytes() if size <= limit else None


def _remote_bytes(location: Location, limit: int) -> tuple[int, bytes | None]:
    with store_errors(location.uri, "reading an input"):
        store = location.parent.obstore()
        try:
            size = obstore.head(store, location.name)["size"]
            return size, bytes(obstore.get(store, location.name).bytes()) if size <= limit else None
        except FileNotFoundError as error:
            raise InputError(f"{location.uri} does not exist", MISSING) from error


def is_pattern(text: str) -> bool:
    """Whether a path holds wildcards."""
    return any(sign in text for sign in "*?[")


def _local(path: Path, suffixes: Collection[str]) -> list[Location] | None:
    try:
        if path.is_dir():
            names = (
                file for file in path.iterdir() if file.suffix.lower() in suffixes and not file.name.startswith(".")
            )
            return [Location("file", "", str(file)) for file in names if file.is_file()]
        if path.is_file():
            return None
        if path.exists():
            raise InputError(f"{path} is neither a file nor a folder", MISSING)
        if is_pattern(str(path)):
            return [Location("file", "", found) for found in glob.glob(str(path)) if Path(found).is_file()]  # noqa: PTH207
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})", "check the path and its permissions") from error
    raise InputError(f"{path} does not exist", MISSING)


def _remote(location: Location, suffixes: Collection[str]) -> list[Location] | None:
    pattern = location.name if is_pattern(location.name) else None
    folder = location.parent if pattern else location
    with store_errors(location.uri, "listing an input"):
        if pattern is None and Path(location.name).suffix:
            return None
        found = obstore.list_with_delimiter(folder.obstore())["objects"]
    names = [_last(entry["path"]) for entry in found]
    if pattern is None:
        return [folder.child(name) for name in names if Path(name).suffix.lower() in suffixes]
    return [folder.child(name) for name in names if fnmatch.fnmatchcase(name, pattern)]
