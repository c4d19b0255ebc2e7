"""How long the disk under a store will do."""

import shutil
from dataclasses import dataclass

from glint.storage.frames.eviction import cached_frames
from glint.storage.locations.location import Location
from glint.storage.versions.objects import object_ids

LOW = 0.1
"""Share of the disk below which free space is called low, whatever is to come."""


@dataclass(frozen=True, slots=True)
class Room:
    """Bytes of the disk that are free and in all; `per_capture`: what a capture's frames take, None until known."""

    free: int
    total: int
    per_capture: int | None

    def warning(self, coming: int) -> str:
        """What to say before `coming` captures are added, empty if they fit."""
        if self.per_capture is not None and self.per_capture * coming > self.free:
            return (
                f"{coming} captures are to come and there is room for about {self.free // self.per_capture}: "
                f"{self.free / 1e9:.1f} GB are free, a capture's frames take {self.per_capture / 1e9:.2f} GB"
            )
        if self.free < LOW * self.total:
            return f"only {self.free / 1e9:.1f} GB of {self.total / 1e9:.0f} GB are free"
        return ""


REMEDY = "make room with `glint maintain --frames-budget SIZE`, or name a larger store"


def room_of(location: Location) -> Room | None:
    """The room on the disk of a local store; None in an object store, which has no end."""
    if location.local is None:
        return None
    place = location.local
    while not place.exists():
        place = place.parent
    usage = shutil.disk_usage(place)
    frames = cached_frames(location)
    return Room(usage.free, usage.total, sum(each.bytes for each in frames) // len(frames) if frames else None)


def new_objects(location: Location, wanted: list[str]) -> list[str]:
    """Of the objects that are wanted those that the store does not have yet."""
    there = set(object_ids(location))
    return [each for each in wanted if each not in there]
