"""Tell a store from an address at which there is none: a path that is misspelt must not pass for an empty store."""

import obstore

from glint.storage.errors import NotFoundError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

STORE_FOLDERS = frozenset({"objects", "frames", "digests", "inbox", "probe"})
"""What a store holds; a folder that holds none of it is a new store, if it is empty."""
NO_STORE_REMEDY = "check the path; `glint run` creates a store"


def check_store(location: Location) -> None:
    """Check that there is a store at a location; an empty folder counts as a new one.

    Raises:
        NotFoundError: no folder, one that holds something else, or a prefix of an object store without a store's keys.
        StoreError: the location cannot be listed.
    """
    if location.is_absent:
        raise NotFoundError(f"there is no store {location.uri}", NO_STORE_REMEDY)
    with store_errors(location.uri, "listing it"):
        if location.local is not None:
            names = {path.name for path in location.local.iterdir()}
        else:
            prefixes = obstore.list_with_delimiter(location.obstore())["common_prefixes"]
            names = {prefix.strip("/").rpartition("/")[2] for prefix in prefixes}
    if names & STORE_FOLDERS:
        return
    if location.local is None:
        raise NotFoundError(f"there is no store {location.uri}", NO_STORE_REMEDY)
    if names:
        raise NotFoundError(f"{location.uri} holds other files and no store", NO_STORE_REMEDY)
