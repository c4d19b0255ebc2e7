"""Names that can be part of a path in a versioned store."""

import re

from glint.storage.errors import StoreError
from glint.storage.locations.location import METADATA_FILE
from glint.storage.versions.stage_results import WHOLE_OBJECT

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")


def is_name(name: str) -> bool:
    """Return whether `name` can be a part of a path in a store."""
    return name == WHOLE_OBJECT or _NAME.fullmatch(name) is not None


def check_name(name: str, kind: str) -> str:
    """Return `name` if it can be a part of a path in a store.

    kind: of the named thing, for the message.

    Raises:
        StoreError: it cannot.
    """
    # Objects have folders of their own, all else lies in a group beside the group's metadata.
    if not is_name(name) or (kind != "object" and name == METADATA_FILE):
        raise StoreError(f"{kind} {name!r} cannot be a name in the store", f"use {_NAME.pattern}, not {METADATA_FILE}")
    return name


def check_file_name(name: str, owner: str) -> str:
    """Return `name` if it is a plain file name, without folders.

    Raises:
        StoreError: it is not.
    """
    if not _FILE_NAME.fullmatch(name) or name == METADATA_FILE:
        raise StoreError(f"{owner} names a file {name!r}, which could leave its folder", "do not trust this store")
    return name
