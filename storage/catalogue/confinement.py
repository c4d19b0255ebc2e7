"""Confine what a catalogue names to folders: an inbox is filled by other people than those whose rights read it."""

import posixpath
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from glint.storage.catalogue.models import ADDRESS_KEYS, Object
from glint.storage.errors import InputError
from glint.storage.footage.images import SUFFIXES
from glint.storage.locations.input_files import expand, is_pattern, list_folder
from glint.storage.locations.location import Location

_ESCAPED = re.compile(r"\[([*?[])\]")
"""A wildcard that stands for itself in a pattern."""


def confined(objects: Iterable[Object], folders: Sequence[Location]) -> tuple[Object, ...]:
    """Return the objects with the addresses that their links lead to, all of which lie in one of the folders.

    Raises:
        InputError: an address leads out of the folders, also by a link; StoreError: an object store cannot be read.
    """
    return tuple(_confined_object(item, folders) for item in objects)


def check_inside(location: Location, folders: Sequence[Location], name: str) -> Location:
    """Return the location that a file's links lead to, which lies in one of the folders; `name`: for the message.

    Raises:
        InputError: it does not.
    """
    target = resolved(location)
    if not any(_contains(resolved(folder), target) for folder in folders):
        raise InputError(
            f"{name} {location.uri} leads out of {folders[0].uri}",
            "copy the file there, or allow its folder with `glint deploy --inbox-may-read FOLDER`",
        )
    return target


def resolved(location: Location) -> Location:
    """Return a location without links, and of an object store without `.` and `..`."""
    if location.local is None:
        return Location(location.scheme, location.container, posixpath.normpath(f"/{location.path}").strip("/"))
    try:
        return Location("file", "", str(location.local.resolve()))
    except (OSError, RuntimeError) as error:
        raise InputError(f"{location.uri} is a link that leads nowhere", "copy the file itself") from error


def _confined_object(item: Object, folders: Sequence[Location]) -> Object:
    captures = tuple(
        capture.model_copy(update=_confined_addresses(capture, f"{item.id}/{capture.id}", folders))
        for capture in item.captures
    )
    return item.model_copy(update={"captures": captures, **_confined_addresses(item, item.id, folders)})


def _confined_addresses(entry: object, name: str, folders: Sequence[Location]) -> dict[str, str]:
    """Return the resolved addresses of an object or a capture by their keys."""
    addresses = {key: getattr(entry, key, None) for key in ADDRESS_KEYS}
    return {
        key: _confined_address(Location.parse(address), f"{name}: {key}", folders)
        for key, address in addresses.items()
        if address is not None
    }


def _confined_address(location: Location, name: str, folders: Sequence[Location]) -> str:
    path = location.local
    if path is None:
        return check_inside(location, folders, name).uri
    if path.exists() or path.is_symlink():
        target = check_inside(location, folders, name)
        for file in list_folder(target)[1] if path.is_dir() else ():
            check_inside(file, folders, name)
        return target.uri
    # A pattern, or nothing: its constant part is checked first, so that no listing shows what lies elsewhere.
    check_inside(Location("file", "", str(_constant_part(path))), folders, name)
    for file in expand(location, SUFFIXES) or ():
        check_inside(file, folders, name)
    return location.uri


def _constant_part(path: Path) -> Path:
    """Return the deepest folder of a pattern whose path holds no wildcard; escaped ones stand for themselves."""
    constant = Path(path.anchor)
    for part in path.parts[1:-1]:
        if is_pattern(_ESCAPED.sub("", part)):
            break
        constant /= _ESCAPED.sub(r"\1", part)
    return constant


def _contains(folder: Location, target: Location) -> bool:
    """Return whether a resolved location lies in a resolved folder."""
    same_place = (folder.scheme, folder.container) == (target.scheme, target.container)
    return same_place and f"{target.path}/".startswith(f"{folder.path.rstrip('/')}/" if folder.path else "")
