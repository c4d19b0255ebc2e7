"""Which objects a store holds."""

import obstore

from glint.storage.errors import StoreError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import check_name


def object_ids(location: Location) -> list[str]:
    """Ids of all objects of a store, sorted; none where there is no store yet."""
    place = location.child("objects")
    if place.local is not None and not place.local.is_dir():
        return []
    with store_errors(location.uri, "listing objects"):
        found = obstore.list_with_delimiter(place.obstore())["common_prefixes"]
    ids = []
    for prefix in found:
        name = prefix.strip("/").rpartition("/")[2]
        try:
            ids.append(check_name(name, "object"))
        except StoreError:
            continue
    return sorted(ids)
