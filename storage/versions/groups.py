"""The groups of a versioned store that hold stages, opened for reading.

They have no checksum of their own: what they say of a stage is verified with the stage. What zarr makes of damaged
metadata becomes an error with a remedy.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zarr
from zarr.core.sync import sync
from zarr.errors import GroupNotFoundError

from glint.storage.errors import DamagedError, damaged


def open_group(store: Any, path: str) -> zarr.Group | None:
    """Open the group at `path` for reading; None if there is none.

    Raises:
        DamagedError: its metadata cannot be read.
    """
    with readable_metadata(path):
        try:
            return zarr.open_group(store, path=path, mode="r", use_consolidated=False, zarr_format=3)
        except GroupNotFoundError as error:
            if sync(store.exists(f"{path}/zarr.json".lstrip("/"))):
                raise _damage(path, error) from error
            return None


@contextmanager
def readable_metadata(path: str) -> Iterator[None]:
    """Raise DamagedError for metadata of the group at `path`, or of those in it, that cannot be read."""
    try:
        yield
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise _damage(path, error) from error


def _damage(path: str, error: Exception) -> DamagedError:
    problem = f"it cannot be read: {' '.join(str(error).split())[:120]}"
    return damaged(f"the metadata of group {path or '/'!r}", problem, "OBJECT")
