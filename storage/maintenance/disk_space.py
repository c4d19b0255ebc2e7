"""Estimate whether a store's disk has room for the captures to come."""

import shutil
from collections.abc import Iterable
from dataclasses import dataclass

from glint.storage.frames.eviction import cached_frames
from glint.storage.locations.location import Location
from glint.storage.versions.repository import object_ids

LOW_FREE_SHARE = 0.1
"""Share of the disk below which free space is called low, however few captures are to come."""

DISK_SPACE_REMEDY = "make room with `glint maintain --frames-budget SIZE`, or name a larger store"


@dataclass(frozen=True, slots=True)
class DiskSpace:
    """Free and total bytes of a disk; `per_capture`: mean bytes of a capture's frames, None until known."""

    free: int
    total: int
    per_capture: int | None

    def warning(self, captures: int) -> str:
        """Return the warning to give before so many captures are added; empty if they fit."""
        if self.per_capture is not None and self.per_capture * captures > self.free:
            return (
                f"{captures} captures are to come and there is room for about {self.free // self.per_capture}: "
                f"{self.free / 1e9:.1f} GB are free, a capture's frames take {self.per_capture / 1e9:.2f} GB"
            )
        if self.free < LOW_FREE_SHARE * self.total:
            return f"only {self.free / 1e9:.1f} GB of {self.total / 1e9:.0f} GB are free"
        return ""


def disk_space(location: Location) -> DiskSpace | None:
    """Return the space on the disk of a local store; None in an object store, which has no limit."""
    if location.local is None:
        return None
    folder = location.local
    while not folder.exists():
        folder = folder.parent
    usage = shutil.disk_usage(folder)
    frames = cached_frames(location)
    per_capture = sum(cache.bytes for cache in frames) // len(frames) if frames else None
    return DiskSpace(usage.free, usage.total, per_capture)


def absent_objects(location: Location, ids: Iterable[str]) -> list[str]:
    """Return those of the objects that the store does not have yet."""
    present = set(object_ids(location))
    return [object_id for object_id in ids if object_id not in present]
