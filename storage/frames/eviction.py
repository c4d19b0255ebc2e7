"""The cache of frames within a budget: what was used least recently goes first."""

import re
import shutil
import stat
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import obstore

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

RECENT = timedelta(hours=1)
"""What was used so lately may be in use."""

_DESCRIPTION = "zarr.json"
_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class CachedFrames:
    """The frames of a capture in the cache: their digest, bytes, and when they were last used."""

    digest: str
    bytes: int
    used: datetime


def cached_frames(location: Location) -> list[CachedFrames]:
    """What the cache holds, the least recently used first. Symbolic links are not followed, other names left out."""
    sizes: dict[str, int] = defaultdict(int)
    used: dict[str, datetime] = {}
    with store_errors(location.uri, "listing frames"):
        for path, size, modified in _files(location):
            digest = path.split("/")[0].partition(".")[0]
            if not _DIGEST.fullmatch(digest):
                continue
            sizes[digest] += size
            used[digest] = max(used.get(digest, modified), modified)
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
    with store_errors(location.uri, "removing frames"):
        for each in chosen:
            if location.local is not None:
                place = location.local / "frames" / each.digest
                (place / _DESCRIPTION).unlink(missing_ok=True)
                shutil.rmtree(place)
                (place.parent / f"{each.digest}.used").unlink(missing_ok=True)
                continue
            store = location.child("frames").obstore()
            obstore.delete(store, f"{each.digest}/{_DESCRIPTION}")
            paths = [path for path, _, _ in _files(location, each.digest)]
            for start in range(0, len(paths), 500):
                obstore.delete(store, paths[start : start + 500])


def mark_used(location: Location, digest: str) -> None:
    """Remember that these frames are used now."""
    with store_errors(location.uri, "marking frames as used"):
        obstore.put(location.obstore(), f"frames/{digest}.used", b"", use_multipart=False)


def _files(location: Location, digest: str = "") -> Iterator[tuple[str, int, datetime]]:
    """Path below the cache, bytes and time of change of every file, of all frames or of those of a digest."""
    if location.local is None:
        for batch in obstore.list(location.child("frames").obstore(), prefix=digest or None):
            for meta in batch:
                yield meta["path"], meta["size"], meta["last_modified"]
        return
    root = location.local / "frames"
    for folder, _, names in root.walk():
        for name in names:
            status = (folder / name).lstat()
            if stat.S_ISREG(status.st_mode):
                path = (folder / name).relative_to(root).as_posix()
                yield path, status.st_size, datetime.fromtimestamp(status.st_mtime, UTC)
