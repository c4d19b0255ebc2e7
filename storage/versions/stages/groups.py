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

from glint.storage.errors import DamagedError, damaged, one_line
from glint.storage.locations.location import METADATA_FILE

LAYOUT_NUMBER = 3
"""Number of this layout, stored in the root group's attribute `layout`; the first layout had no number."""


def open_group(store: Any, object_id: str, path: str) -> zarr.Group | None:
    """Open the group at `path` of an object's store for reading; None if there is none.

    Raises:
        DamagedError: its metadata cannot be read.
    """
    with readable_metadata(object_id, path):
        try:
            return zarr.open_group(store, path=path, mode="r", use_consolidated=False, zarr_format=3)
        except GroupNotFoundError as error:
            if sync(store.exists(f"{path}/{METADATA_FILE}".lstrip("/"))):
                raise _damage(object_id, path, error) from error
            return None


@contextmanager
def readable_metadata(object_id: str, path: str) -> Iterator[None]:
    """Raise DamagedError for metadata of an object's group at `path`, or of those in it, that cannot be read."""
    try:
        yield
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise _damage(object_id, path, error) from error


def _damage(object_id: str, path: str, error: Exception) -> DamagedError:
    problem = f"its metadata cannot be read: {one_line(error)}"
    return damaged(f"{object_id}/{path}" if path else f"the root of object {object_id}", problem, object_id)
