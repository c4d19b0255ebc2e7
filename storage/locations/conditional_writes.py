"""Conditional writes to an object store: make what is absent, replace what is as it was seen."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import obstore
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import ObjectStore

if TYPE_CHECKING:
    from obstore import UpdateVersion


def create(store: ObjectStore, key: str, data: bytes) -> bool:
    """Write `data` unless `key` is there; whether it was written."""
    try:
        obstore.put(store, key, data, mode="create", use_multipart=False)
    except AlreadyExistsError:
        return False
    return True


def swap(store: ObjectStore, key: str, data: bytes, seen: Mapping[str, Any], quoted: bool = True) -> bool:
    """Write `data` if `key` still is what was `seen` (the store's answer to a put or a get); whether it was written.

    quoted: send the entity tag in its quotes, as the standard has it; Ceph's gateway compares it without.
    """
    condition: UpdateVersion = {}
    if seen["e_tag"]:
        condition["e_tag"] = seen["e_tag"] if quoted else seen["e_tag"].strip('"')
    if seen["version"]:
        condition["version"] = seen["version"]
    try:
        obstore.put(store, key, data, mode=condition, use_multipart=False)
    except PreconditionError:
        return False
    return True
