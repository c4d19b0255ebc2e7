"""Blobs that no result names any more."""

import re
from collections.abc import Iterable
from datetime import datetime

import obstore

from glint.storage.blobs.store import deleting
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.versions.garbage import Garbage

_NAME = re.compile(r"blobs/sha256/[0-9a-f]{2}/[0-9a-f]{64}")


def old_blobs(location: Location, limit: datetime) -> dict[str, int]:
    """Bytes by key of the blobs that were last stored before `limit`."""
    with store_errors(location.uri, "listing blobs"):
        listed = obstore.list(location.obstore(), prefix="blobs/sha256")
        return {
            meta["path"]: meta["size"]
            for batch in listed
            for meta in batch
            if meta["last_modified"] < limit and _NAME.fullmatch(meta["path"])
        }


def collect_blobs(
    location: Location, candidates: dict[str, int], named: Iterable[str], limit: datetime, dry_run: bool
) -> Garbage:
    """Remove of the `candidates`, found by `old_blobs` before the names were read, those that nobody names.

    A blob that was stored again since then, by a run that is about to name it, stays.
    """
    spare = sorted(candidates.keys() - set(named))
    if dry_run:
        return Garbage(len(spare), sum(candidates[key] for key in spare))
    store, removed = location.obstore(), list[str]()
    with store_errors(location.uri, "removing blobs"):
        for key in spare:
            with deleting(location):
                try:
                    if obstore.head(store, key)["last_modified"] < limit:
                        obstore.delete(store, key)
                        removed.append(key)
                except FileNotFoundError:
                    continue
    return Garbage(len(removed), sum(candidates[key] for key in removed))
