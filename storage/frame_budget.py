"""The cache of frames within a budget: what was used least recently goes first."""

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import obstore

from storage.faults import store_faults
from storage.location import Location

RECENT = timedelta(hours=1)
"""What was used so lately may be in use."""

_ATTRIBUTES = "zarr.json"


@dataclass(frozen=True, slots=True)
class CachedFrames:
    """The frames of a capture in the cache: their digest, bytes, and when they were last used."""

    digest: str
    bytes: int
    used: datetime


def cached_frames(location: Location) -> list[CachedFrames]:
    """What the cache holds, the least recently used first."""
    sizes: dict[str, int] = defaultdict(int)
    used: dict[str, datetime] = {}
    if location.local is not None and not (location.local / "frames").is_dir():
        return []
    with store_faults(location.uri, "listing frames"):
        for batch in obstore.list(location.obstore(), prefix="frames"):
            for meta in batch:
                digest = meta["path"].split("/")[1].partition(".")[0]
                sizes[digest] += meta["size"]
                used[digest] = max(used.get(digest, meta["last_modified"]), meta["last_modified"])
    found = [CachedFrames(digest, size, used[digest]) for digest, size in sizes.items() if size]
    return sorted(found, key=lambda each: (each.used, each.digest))


def over_budget(
    frames: Collection[CachedFrames], budget: int, in_use: Collection[str], now: datetime | None = None
) -> list[CachedFrames]:
    """What must go for the rest to take `budget` bytes at most, except what is in use or was lately."""
    excess = sum(each.bytes for each in frames) - budget
    fresh = (now or datetime.now(UTC)) - RECENT
    chosen = []
    for each in frames:
        if excess <= 0:
            break
        if each.digest not in in_use and each.used < fresh:
            chosen.append(each)
            excess -= each.bytes
    return chosen


def remove_frames(location: Location, chosen: Collection[CachedFrames]) -> None:
    """Remove frames from the cache. The description goes first: what is left of a removal that died is no cache."""
    store = location.obstore()
    with store_faults(location.uri, "removing frames"):
        for each in chosen:
            place = f"frames/{each.digest}"
            keys = [meta["path"] for batch in obstore.list(store, prefix=place) for meta in batch]
            head = f"{place}/{_ATTRIBUTES}"
            if head in keys:
                obstore.delete(store, head)
                keys.remove(head)
            for start in range(0, len(keys), 500):
                obstore.delete(store, keys[start : start + 500])
            _remove_folders(location, place)


def mark_used(location: Location, digest: str) -> None:
    """Remember that these frames are used now."""
    with store_faults(location.uri, "marking frames as used"):
        obstore.put(location.obstore(), f"frames/{digest}.used", b"", use_multipart=False)


def _remove_folders(location: Location, place: str) -> None:
    """Remove what an object store has not: empty folders."""
    if location.local is None:
        return
    root = location.local / place
    for folder, _, _ in root.walk(top_down=False):
        folder.rmdir()
