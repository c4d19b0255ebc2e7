"""Values that follow from an object's results, kept beside them: a cache, computed again when they are gone.

STORE/objects/<id>/kept/<key>.json, sealed; the key is the digest of all that the value follows from.
"""

import json
from typing import Any

import obstore

from glint.storage.errors import InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import read_bytes
from glint.storage.locations.location import Location
from glint.storage.seals import is_sealed, sealed

KEPT_FOLDER = "kept"
MAX_VALUE_BYTES = 50_000_000
"""Size of the largest value that is kept."""


def read_kept(location: Location, object_id: str, key: str) -> Any:
    """Return the JSON value that was kept under a key (hex); None if there is none, or it is not whole."""
    try:
        kept = json.loads(read_bytes(_place(location, object_id, key), MAX_VALUE_BYTES))
    except (InputError, ValueError):
        return None
    return kept["value"] if isinstance(kept, dict) and kept.get("key") == key and is_sealed(kept) else None


def keep(location: Location, object_id: str, key: str, value: Any) -> None:
    """Keep a JSON value under a key (hex).

    Raises:
        StoreError: the store cannot be written.
    """
    data = json.dumps(sealed({"key": key, "value": value}), allow_nan=False).encode()
    place = _place(location, object_id, key)
    if len(data) <= MAX_VALUE_BYTES:
        with store_errors(location.uri, "keeping a value"):
            obstore.put(place.parent.obstore(), place.name, data, use_multipart=False)


def _place(location: Location, object_id: str, key: str) -> Location:
    return location.child("objects", object_id, KEPT_FOLDER, f"{key}.json")
