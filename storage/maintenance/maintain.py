"""Remove what no version needs from a store, keep the cache of frames within a budget, and check the disk's free space.

Never removed: data of a version, the newest results of an object, the edits of its inputs, and data of an object that
is being run. A dry run removes nothing and reports what would be removed.
"""

from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from glint.storage import kept_values
from glint.storage.edits import overlay
from glint.storage.errors import StoreError
from glint.storage.frames.eviction import cached_frames, over_budget, remove_frames
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_lock, run_owner
from glint.storage.locking.owner import ObjectBusy
from glint.storage.maintenance.disk_space import disk_space
from glint.storage.versions.garbage import Garbage, remove_old_files
from glint.storage.versions.repository import ObjectRepository, object_ids

UNITS = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
MAX_SIZE = 1e18
CACHES = (overlay.FOLDER, kept_values.KEPT_FOLDER)
"""Folders of an object whose files are made again when they are gone."""
MIN_SHARED_AGE = timedelta(hours=1)
"""Least age of what is removed from an object store, where nothing keeps a run from beginning beside a cleaning: longer
than any save takes."""


@dataclass(frozen=True, slots=True)
class Cleaning:
    """Items removed (or to be removed) from a `target`: an object, or `frames`.

    note: the versions that were removed, or why nothing was; failed: the target could not be read.
    """

    target: str
    objects: int
    bytes: int
    note: str = ""
    failed: bool = False


@dataclass(frozen=True, slots=True)
class Maintenance:
    """The result of maintenance (of a dry run: what it would do); `warning`: about the disk's space, empty if none."""

    store: str
    dry_run: bool
    cleanings: tuple[Cleaning, ...]
    warning: str = ""

    @property
    def bytes(self) -> int:
        """Bytes of all that was removed."""
        return sum(cleaning.bytes for cleaning in self.cleanings)

    @property
    def failed(self) -> list[Cleaning]:
        """Targets that could not be read."""
        return [cleaning for cleaning in self.cleanings if cleaning.failed]

    @property
    def summary(self) -> str:
        """The bytes that were freed, in words."""
        return f"{'would free at least' if self.dry_run else 'freed'} {format_size(self.bytes)}"

    def rows(self) -> list[dict[str, Any]]:
        """Return table rows; objects from which nothing was removed are left out."""
        title = "would remove" if self.dry_run else "removed"
        return [
            {"target": item.target, title: item.objects, "MB": round(item.bytes / 1e6, 2), "note": item.note}
            for item in self.cleanings
            if item.objects or item.note or item.target == "frames"
        ]


def maintain(
    location: Location,
    *,
    age: timedelta,
    dry_run: bool = False,
    keep: int | None = None,
    frames_budget: int | None = None,
) -> Maintenance:
    """Clean objects, then cached frames, then check the disk. An unreadable object does not stop the rest.

    Args:
        location: of the store.
        age: only data unused for that long is removed, in an object store for at least an hour.
        dry_run: whether to remove nothing, and only report what would be removed.
        keep: versions of each object to keep; None: all.
        frames_budget: bytes that the cache of frames may take; None: no limit.

    Raises:
        StoreError: the store cannot be listed.
    """
    ids = object_ids(location)
    age = age if location.local is not None else max(age, MIN_SHARED_AGE)
    cleanings = [_clean_object(location, object_id, dry_run, keep, age) for object_id in ids]
    cleanings.append(_clean_frames(location, frames_budget, dry_run))
    space = disk_space(location)
    # A tenth more objects should fit.
    warning = "" if space is None else space.warning(max(1, len(ids) // 10))
    return Maintenance(location.uri, dry_run, tuple(cleanings), warning)


def format_size(size: int) -> str:
    """Format bytes as `parse_size` reads them, such as 1.5 GB."""
    unit = next((unit for unit in ("TB", "GB") if size >= UNITS[unit]), "MB")
    return f"{size / UNITS[unit]:.1f} {unit}"


def parse_size(text: str) -> int:
    """Parse the bytes of a size such as 500MB, 20GB or 1.5TB; only 0 needs no unit.

    Raises:
        ValueError: it is not a size.
    """
    if text.strip() == "0":
        return 0
    number = text.strip().upper().rstrip("KMGTB")
    unit = text.strip().upper()[len(number) :]
    with suppress(KeyError, ValueError):
        size = float(number) * UNITS[unit]
        if 0 <= size < MAX_SIZE:
            return int(size)
    raise ValueError(f"{text!r} is not a size")


def _clean_object(location: Location, object_id: str, dry_run: bool, keep: int | None, age: timedelta) -> Cleaning:
    try:
        owner = run_owner(location, object_id)
        if owner is not None:
            raise ObjectBusy.owned_by(object_id, owner)
        garbages = _remove_caches(location, object_id, age, dry_run)
        repository = ObjectRepository.open(location, object_id, create=False)
        removed = [] if keep is None else repository.prune(keep, dry_run)
        garbages.append(repository.garbage_collect(dry_run, age))
    except ObjectBusy:
        return Cleaning(object_id, 0, 0, "being run: left alone")
    except StoreError as error:
        return Cleaning(object_id, 0, 0, str(error), failed=True)
    note = f"{'would remove' if dry_run else 'removed'} {', '.join(removed)}" if removed else ""
    return Cleaning(object_id, sum(item.objects for item in garbages), sum(item.bytes for item in garbages), note)


def _remove_caches(location: Location, object_id: str, age: timedelta, dry_run: bool) -> list[Garbage]:
    """Remove the old files of an object's caches; a store that may only be read is not locked.

    Raises:
        ObjectBusy: a run has begun.
    """
    garbages = [remove_old_files(location, object_id, folder, age, dry_run=True) for folder in CACHES]
    if dry_run or not any(item.objects for item in garbages):
        return garbages
    # A store is cleaned for hours, in which runs begin: one relies on a cached file that it found whole.
    with run_lock(location, object_id, "glint maintain"):
        return [remove_old_files(location, object_id, folder, age, dry_run=False) for folder in CACHES]


def _clean_frames(location: Location, budget: int | None, dry_run: bool) -> Cleaning:
    """Remove cached frames beyond the budget, except those of objects that are being run.

    None are removed while such an object cannot be read: it may be damaged, or in the first moments of its first run.
    """
    frames = cached_frames(location)
    total = sum(cache.bytes for cache in frames)
    if budget is None:
        return Cleaning("frames", 0, 0, f"{format_size(total)} cached, no budget set")
    try:
        held = [object_id for object_id in object_ids(location) if run_owner(location, object_id) is not None]
        in_use = {digest for object_id in held for digest in _frame_digests(location, object_id)}
    except StoreError as error:
        return Cleaning("frames", 0, 0, f"left alone, as what a run uses of them is unknown: {error}")
    chosen = over_budget(frames, budget, in_use)
    if not dry_run:
        remove_frames(location, chosen)
    removed = Garbage(len(chosen), sum(cache.bytes for cache in chosen))
    excess = total - removed.bytes - budget
    note = f"{format_size(excess)} over the budget were used within the hour, or are in use" if excess > 0 else ""
    return Cleaning("frames", removed.objects, removed.bytes, note)


def _frame_digests(location: Location, object_id: str) -> list[str]:
    """Return the digests of the cached frames that an object's newest results refer to."""
    repository = ObjectRepository.open(location, object_id, create=False)
    records = [repository.records(capture) for capture in repository.captures()]
    return [str(stages["frames"][1]["cache"]) for stages in records if "frames" in stages]
