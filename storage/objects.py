"""Which objects a store holds."""

import obstore

from storage.errors import StoreError
from storage.faults import store_faults
from storage.location import Location
from storage.results import check_name


def object_ids(location: Location) -> list[str]:
    """Ids of all objects of a store, sorted; none where there is no store yet."""
    place = location.child("objects")
    if place.local is not None and not place.local.is_dir():
        return []
    with store_faults(location.uri, "listing objects"):
        found = obstore.list_with_delimiter(place.obstore())["common_prefixes"]
    ids = []
    for prefix in found:
        name = prefix.strip("/").rpartition("/")[2]
        try:
            ids.append(check_name(name, "object"))
        except StoreError:
            continue
    return sorted(ids)
