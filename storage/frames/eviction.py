"""Keep the cache of frames within a budget: evict the least recently used first."""

import re
import shutil
import stat
from collections import defaultdict
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import obstore

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import METADATA_FILE, Location

MIN_IDLE = timedelta(hours=1)
"""Frames used more recently may be in use, and are kept."""

KEYS_PER_DELETION = 500
"""Files that one call removes from an object store, which takes at most 1,000 of them in a request."""
_DIGEST = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class CachedFrames:
    """The frames of a capture in the cache: digest, size in bytes, and time of last use."""

    digest: str
    bytes: int
    used: datetime


def cached_frames(location: Location) -> list[CachedFrames]:
    """List the cached frames, the least recently used first; symbolic links and other names are ignored."""
    sizes: dict[str, int] = defaultdict(int)
    used: dict[str, datetime] = {}
    with store_errors(location.uri, "listing frames"):
        for path, size, modified in _files(location):
            digest = path.split("/")[0].partition(".")[0]
            if not _DIGEST.fullmatch(digest):
                continue
            sizes[digest] += size
            used[digest] = max(used.get(digest, modified), modified)
    cached = [CachedFrames(digest, size, used[digest]) for digest, size in sizes.items() if size]
    return sorted(cached, key=lambda entry: (entry.used, entry.digest))


def over_budget(
    frames: Collection[CachedFrames], budget: int, in_use: Collection[str], now: datetime | None = None
) -> list[CachedFrames]:
    """Return the frames to evict so that the rest takes `budget` bytes at most; recently used ones are kept."""
    excess = sum(entry.bytes for entry in frames) - budget
    last_idle = (now or datetime.now(UTC)) - MIN_IDLE
    chosen = []
    for entry in frames:
        if excess <= 0:
            break
        if entry.digest not in in_use and entry.used < last_idle:
            chosen.append(entry)
            excess -= entry.bytes
    return chosen


def remove_frames(location: Location, chosen: Collection[CachedFrames]) -> None:
    """Remove frames, their group's metadata first, so that an interrupted removal leaves no valid cache."""
    with store_errors(location.uri, "removing frames"):
        for entry in chosen:
            if location.local is not None:
                _remove_folder(location.local / "frames", entry.digest)
                continue
            store = location.child("frames").obstore()
            obstore.delete(store, f"{entry.digest}/{METADATA_FILE}")
            paths = [path for path, _, _ in _files(location, entry.digest)]
            for start in range(0, len(paths), KEYS_PER_DELETION):
                obstore.delete(store, paths[start : start + KEYS_PER_DELETION])
            with suppress(FileNotFoundError):  # what some stores answer for frames that were never marked
                obstore.delete(store, f"{entry.digest}.used")


def discard_frames(location: Location, digest: str) -> None:
    """Remove frames that are damaged; it does not matter if another process does so too."""
    with store_errors(location.uri, "removing frames"):
        if location.local is None:
            remove_frames(location, [CachedFrames(digest, 0, datetime.now(UTC))])
            return
        # The other process may be filling them again by now.
        _remove_folder(location.local / "frames", digest, ignored=OSError)


def _remove_folder(cache: Path, digest: str, ignored: type[OSError] = FileNotFoundError) -> None:
    """Remove the frames of a digest; by default it does not matter if another process removes them too."""

    def ignore(function: object, path: str, error: BaseException) -> None:
        if not isinstance(error, ignored):
            raise error

    (cache / digest / METADATA_FILE).unlink(missing_ok=True)
    shutil.rmtree(cache / digest, onexc=ignore)
    (cache / f"{digest}.used").unlink(missing_ok=True)


def mark_used(location: Location, digest: str) -> None:
    """Record that these frames are used now."""
    with store_errors(location.uri, "marking frames as used"):
        obstore.put(location.obstore(), f"frames/{digest}.used", b"", use_multipart=False)


def _files(location: Location, digest: str = "") -> Iterator[tuple[str, int, datetime]]:
    """Yield path below the cache, size in bytes and time of change of all files, or of those of a digest.

    Files that vanish meanwhile are left out: a writer renames its own, and another process may evict some.
    """
    if location.local is None:
        for batch in obstore.list(location.child("frames").obstore(), prefix=digest or None):
            for meta in batch:
                yield meta["path"], meta["size"], meta["last_modified"]
        return
    root = location.local / "frames"
    for folder, _, names in root.walk():
        for name in names:
            try:
                status = (folder / name).lstat()
            except FileNotFoundError:
                continue
            if stat.S_ISREG(status.st_mode):
                path = (folder / name).relative_to(root).as_posix()
                yield path, status.st_size, datetime.fromtimestamp(status.st_mtime, UTC)
