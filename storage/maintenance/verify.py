"""Verify a store: read everything of every version, of the newest results, and on request of the cache of frames."""

import os
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial

from glint.storage.edits.edits import Edits
from glint.storage.errors import DamagedError, StoreError, StoreUnreachable
from glint.storage.frames.cache import FrameCache
from glint.storage.frames.errors import DamagedFrames
from glint.storage.frames.eviction import cached_frames
from glint.storage.locations.location import Location
from glint.storage.locations.store_folder import check_store
from glint.storage.locking.locks import run_owner
from glint.storage.versions.repository import ObjectRepository, object_ids
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.storage.versions.verification import Verification, verify_capture

WORK = "work"
"""Ref of the newest results, from which a run resumes."""

EDIT = "edit "
"""Beginning of the name of an edit, before its number."""

MAX_READERS = 8
"""Captures that are read at once; each reads several values at once."""

FRAMES_REMEDY = "nothing is lost: the next run decodes the frames again, and --repair removes the damaged ones"


@dataclass(frozen=True, slots=True)
class Damage:
    """Something damaged: an object's version (or `work`, an edit, or all of it, then empty), or cached frames.

    frames: their digest, empty for an object.
    """

    object_id: str
    version: str
    message: str
    remedy: str
    frames: str = ""

    @property
    def is_edit(self) -> bool:
        """True for a person's edits, which no catalogue can rebuild."""
        return self.version.startswith(EDIT)


@dataclass(frozen=True, slots=True)
class StoreVerification:
    """Result of a verification: how much was read of a store, and the damage found."""

    store: str
    objects: int
    versions: int
    bytes: int
    damages: tuple[Damage, ...]

    @property
    def summary(self) -> str:
        """The result in words."""
        read = f"read {self.bytes / 1e6:,.1f} MB; objects: {self.objects:,}, versions: {self.versions:,}"
        return f"{read}, damaged: {len(self.damages):,}" if self.damages else f"{read}: no damage found"


Part = Callable[[], tuple[int, list[Damage]]]
"""Reads a part of a store; returns its bytes and what of it is damaged."""


def verify_store(
    location: Location,
    chosen: Collection[str] = (),
    frames: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> StoreVerification:
    """Read all of these objects (by default of all), and compare it with what was written.

    frames: whether to read the cache of frames too; progress: called with (parts done, all parts).

    Raises:
        StoreError: there is no store, it does not answer, or an object of `chosen` is absent or of another layout.
    """
    check_store(location)
    ids = sorted(chosen) or object_ids(location)
    parts, damages = list[Part](), list[Damage]()
    versions = dict[str, list[str]]()
    for object_id in ids:
        try:
            repository = ObjectRepository.open(location, object_id, create=False)
            versions[object_id] = repository.version_names()
            parts += [*_parts(repository, versions[object_id]), *_edit_parts(repository)]
        except StoreError as error:
            # Of all objects, one that cannot be read must not hide the damage of the others.
            if isinstance(error, StoreUnreachable) or (object_id in chosen and not isinstance(error, DamagedError)):
                raise
            if run_owner(location, object_id) is not None:
                continue  # its first run has begun, and made a folder so far
            damages.append(Damage(object_id, "", error.message, error.remedy))
    if frames:
        parts += [partial(_verify_frames, location, cache.digest) for cache in cached_frames(location)]
    size, part_damages = _read(parts, progress)
    damages += part_damages
    damages = [_with_remedy(damage, damages, versions.get(damage.object_id, [])) for damage in damages]
    ordered = sorted(set(damages), key=lambda damage: (damage.object_id, damage.version, damage.message))
    return StoreVerification(location.uri, len(ids), sum(map(len, versions.values())), size, tuple(ordered))


def _read(parts: Collection[Part], progress: Callable[[int, int], None]) -> tuple[int, list[Damage]]:
    """Read parts side by side; return their bytes together, and all that is damaged.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    size, damages = 0, list[Damage]()
    with ThreadPoolExecutor(min(MAX_READERS, 2 * (os.cpu_count() or 1))) as pool:
        futures = [pool.submit(part) for part in parts]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                read, damaged = future.result()
                size += read
                damages += damaged
                progress(done, len(parts))
        finally:
            # After an interrupt, or where the store has gone away, the parts that have not begun are left unread.
            pool.shutdown(wait=False, cancel_futures=True)
    return size, damages


def _parts(repository: ObjectRepository, names: Collection[str]) -> Iterator[Part]:
    """Yield the captures of all versions and of the newest results.

    Raises:
        DamagedError: the index is damaged.
    """
    for ref in (*names, WORK):
        try:
            captures = (*repository.captures(), WHOLE_OBJECT) if ref == WORK else repository.version(ref).stages
        except DamagedError as error:
            yield partial(_known, Damage(repository.object_id, ref, error.message, error.remedy))
            continue
        for capture in captures:
            yield partial(_verify_capture, repository, ref, capture)


def _edit_parts(repository: ObjectRepository) -> Iterator[Part]:
    """Yield all that people did to the inputs of an object's captures.

    Raises:
        DamagedError: their history is damaged.
    """
    edits = Edits(repository)
    history = edits.history()
    for revision in history:
        newest = history[-1].seals[revision.capture] == revision.seals[revision.capture]
        past = f"the newest edits do not need it; only a backup brings edit {revision.number} back"
        yield partial(_verify_edit, edits, revision.number, "" if newest else past)


def _verify_edit(edits: Edits, number: int, remedy: str) -> tuple[int, list[Damage]]:
    """Read an edit; remedy: of its damage, empty: that of the error."""
    outcome, name = edits.verify(number), f"{EDIT}{number}"
    named = [Damage(edits.object_id, name, error.message, remedy or error.remedy) for error in outcome.damages]
    return outcome.bytes, named


def _with_remedy(damage: Damage, damages: Collection[Damage], versions: list[str]) -> Damage:
    """Return the damage with its remedy: of a version before a whole one, nothing is left to compute again."""
    if damage.version not in versions[:-1]:
        return damage
    needed = {WORK, versions[-1]}
    if needed & {second.version for second in damages if second.object_id == damage.object_id}:
        return damage
    return replace(damage, remedy=f"{versions[-1]} is whole; only a backup brings {damage.version} back")


def _known(damage: Damage) -> tuple[int, list[Damage]]:
    return 0, [damage]


def _verify_capture(repository: ObjectRepository, ref: str, capture: str) -> tuple[int, list[Damage]]:
    outcome: Verification = verify_capture(repository, capture, ref)
    named = [Damage(repository.object_id, ref, error.message, error.remedy) for error in outcome.damages]
    return outcome.bytes, named


def _verify_frames(location: Location, digest: str) -> tuple[int, list[Damage]]:
    read, damages = 0, list[Damage]()
    try:
        cache = FrameCache.open(location, digest)
        for name in cache.crops:
            for start in range(0, cache.frames, cache.shard_frames):
                read += cache.read(name, slice(start, start + cache.shard_frames)).nbytes
    except StoreUnreachable:
        raise
    except (DamagedFrames, StoreError) as error:
        damages.append(Damage("", "", error.message, FRAMES_REMEDY, digest))
    return read, damages
