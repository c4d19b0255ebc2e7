"""The maintenance flow: what nothing needs any more is removed, the cache of frames kept within its budget.

Never removed: what a version holds, the newest work of an object, and whatever belongs to an object that is
being run. A dry run removes nothing and tells what it would.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from prefect import flow
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.client.schemas.objects import State
from prefect.events import emit_event
from prefect.states import Completed, Failed

from glint.flows.reporting.artifacts import artifact_key, plain
from glint.storage.errors import StoreError
from glint.storage.frames.eviction import cached_frames, over_budget, remove_frames
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_holder
from glint.storage.maintenance.disk_space import REMEDY, room_of
from glint.storage.versions.garbage import Garbage
from glint.storage.versions.objects import object_ids
from glint.storage.versions.repository import ObjectRepository

DISK_EVENT = "glint.disk-low"
"""Name of the event; its resource is `glint.store`, its payload says how many bytes are free."""


@dataclass(frozen=True, slots=True)
class Cleaning:
    """What was removed of a kind (`what`: an object, `frames`), or would be; `note`: what was given up, or
    why nothing was removed; `failed`: it could not be looked at."""

    what: str
    objects: int
    bytes: int
    note: str = ""
    failed: bool = False


@dataclass(frozen=True, slots=True)
class Maintenance:
    """What maintenance did, or would do (`dry_run`); `warning`: what to know of the disk, empty if all is well."""

    store: str
    dry_run: bool
    cleanings: tuple[Cleaning, ...]
    warning: str = ""

    @property
    def bytes(self) -> int:
        """Bytes of all that was removed."""
        return sum(each.bytes for each in self.cleanings)


@flow(name="maintenance", flow_run_name="{store}", validate_parameters=False, persist_result=False)
def run_maintenance(
    store: str,
    dry_run: bool = False,
    keep: int | None = None,
    older_than: float = 1.0,
    frames_budget: int | None = None,
) -> State[Maintenance]:
    """Collect garbage older than `older_than` days, and bring the cache of frames down to `frames_budget` bytes.

    keep: versions of each object that stay, the newest ones; None: all.
    """
    done = maintain(Location.parse(store), dry_run, keep, timedelta(days=older_than), frames_budget)
    rows = rows_of(done)
    create_table_artifact(rows, key=artifact_key(f"maintenance {store}"), description=plain(store))
    if done.warning:
        create_markdown_artifact(f"{plain(done.warning)}\n\n{plain(REMEDY)}", key=artifact_key(f"disk {store}"))
        emit_event(
            DISK_EVENT,
            resource={"prefect.resource.id": "glint.store", "prefect.resource.name": store},
            payload={"store": store, "warning": done.warning, "remedy": REMEDY},
        )
    failed = [each for each in done.cleanings if each.failed]
    if failed:
        return Failed(message=f"{len(failed)} not maintained; {failed[0].what}: {failed[0].note}", data=done)
    return Completed(message=f"{'would free' if dry_run else 'freed'} {done.bytes / 1e6:.1f} MB", data=done)


def maintain(
    place: Location, dry_run: bool, keep: int | None, age: timedelta, frames_budget: int | None
) -> Maintenance:
    """Objects first, then frames, then a look at the disk. One object's trouble does not stop the rest.

    Raises:
        StoreError: the store cannot be listed.
    """
    ids = object_ids(place)
    held = {each for each in ids if run_holder(place, each) is not None}
    cleanings = []
    for each in ids:
        try:
            repository = ObjectRepository.open(place, each, create=False)
            if each in held:
                cleanings.append(Cleaning(each, 0, 0, "being run: left alone"))
            else:
                cleanings.append(_clean_object(repository, dry_run, keep, age))
        except StoreError as error:
            cleanings.append(Cleaning(each, 0, 0, str(error), failed=True))
    cleanings.append(_clean_frames(place, frames_budget, held, dry_run))
    room = room_of(place)
    return Maintenance(
        place.uri, dry_run, tuple(cleanings), "" if room is None else room.warning(max(1, len(ids) // 10))
    )


def rows_of(done: Maintenance) -> list[dict[str, Any]]:
    """What was removed, for a table; objects of which nothing was are left out."""
    title = "would remove" if done.dry_run else "removed"
    return [
        {"what": each.what, title: each.objects, "MB": round(each.bytes / 1e6, 2), "note": each.note}
        for each in done.cleanings
        if each.objects or each.note or each.what == "frames"
    ]


def _clean_object(repository: ObjectRepository, dry_run: bool, keep: int | None, age: timedelta) -> Cleaning:
    given_up = [] if keep is None else repository.give_up(keep, dry_run)
    garbage = repository.garbage_collect(dry_run, age)
    note = f"{'would give' if dry_run else 'gave'} up {', '.join(given_up)}" if given_up else ""
    return Cleaning(repository.object_id, garbage.objects, garbage.bytes, note)


def _clean_frames(place: Location, budget: int | None, held: set[str], dry_run: bool) -> Cleaning:
    """Frames beyond the budget, except those that the objects which are being run need."""
    frames = cached_frames(place)
    total = sum(each.bytes for each in frames)
    if budget is None:
        return Cleaning("frames", 0, 0, f"{size_text(total)} in the cache, no budget given")
    in_use = {digest for each in held for digest in _frames_of(place, each)}
    chosen = over_budget(frames, budget, in_use)
    if not dry_run:
        remove_frames(place, chosen)
    removed = Garbage(len(chosen), sum(each.bytes for each in chosen))
    over = total - removed.bytes - budget
    note = f"{size_text(over)} over the budget are in use" if over > 0 else ""
    return Cleaning("frames", removed.objects, removed.bytes, note)


def _frames_of(place: Location, object_id: str) -> list[str]:
    """Caches that the newest work of an object names."""
    repository = ObjectRepository.open(place, object_id, create=False)
    records = [repository.records(capture) for capture in repository.captures()]
    return [str(of["frames"][1]["cache"]) for of in records if "frames" in of]


def size_text(size: int) -> str:
    """Bytes for people, as `size_of` reads them."""
    unit, scale = next(((unit, scale) for unit, scale in (("TB", 1e12), ("GB", 1e9)) if size >= scale), ("MB", 1e6))
    return f"{size / scale:.1f} {unit}"


def size_of(text: str) -> int:
    """Bytes of a size such as 500MB, 20GB or 1.5TB.

    Raises:
        ValueError: it is none.
    """
    units = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
    number = text.strip().upper().rstrip("KMGTB")
    unit = text.strip().upper()[len(number) :]
    size = float(number) * units[unit] if unit in units else -1.0
    if not 0 <= size < 1e18:
        raise ValueError(f"{text!r} is no size")
    return int(size)
