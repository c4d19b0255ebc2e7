"""Repair what can be repaired without the catalogue: an object's index, its branches, damaged cached frames."""

from contextlib import suppress

import icechunk
import obstore

from glint.storage.edits.edits import Edits
from glint.storage.edits.recovery import recover
from glint.storage.errors import DamagedError, StoreError, StoreUnreachable
from glint.storage.frames.eviction import discard_frames
from glint.storage.locations.location import Location
from glint.storage.locking.locks import mutation_lock, run_lock
from glint.storage.maintenance.verify import Damage
from glint.storage.versions.opening import open_repository
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.snapshots import read_session, version_names
from glint.storage.versions.transaction import repository_folder

INDEX = "repo"
"""File of the index in an object's repository; the library keeps copies of it in the folder `overwritten`."""


def repair(location: Location, damages: tuple[Damage, ...]) -> list[str]:
    """Restore damaged indexes from their newest whole copy, go back to edits that can be read, remove damaged frames.

    Objects that cannot be read for another reason are left alone.
    Returns what was done, in sentences.

    Raises:
        StoreError: the store cannot be written; ObjectBusy: a run works on an object.
    """
    done = []
    for object_id in sorted({damage.object_id for damage in damages if damage.object_id and not damage.version}):
        problem = _problem(location, object_id)
        if isinstance(problem, DamagedError):
            with run_lock(location, object_id, "glint verify --repair"), mutation_lock(location, object_id):
                done.append(_restore_index(location, object_id))
        elif problem is not None:
            done.append(f"left {object_id} alone, as no repair helps: {problem}")
        elif (lost := _edits_problem(location, object_id)) is not None:
            done.append(f"left the edits of {object_id} alone, as no repair helps: {lost}")
    for object_id in sorted({damage.object_id for damage in damages if damage.is_edit}):
        done += filter(None, [recover(ObjectRepository.open(location, object_id, create=False))])
    for damage in damages:
        if damage.frames:
            discard_frames(location, damage.frames)
            done.append(f"removed the damaged frames {damage.frames}")
    return done


def _restore_index(location: Location, object_id: str) -> str:
    folder = repository_folder(location, object_id)
    store = folder.obstore()
    listed = [meta for batch in obstore.list(store, prefix="overwritten") for meta in batch]
    with suppress(FileNotFoundError):
        damaged = bytes(obstore.get(store, INDEX).bytes())
        if _reset_work(location, object_id):
            return f"set the newest results of {object_id} back to its newest version"
        obstore.put(store, "damaged-index", damaged, use_multipart=False)
    for meta in sorted(listed, key=lambda meta: meta["last_modified"], reverse=True):
        obstore.put(store, INDEX, bytes(obstore.get(store, meta["path"]).bytes()), use_multipart=False)
        if _problem(location, object_id) is None or _reset_work(location, object_id):
            return f"restored the index of {object_id} as it was before its last change"
    return f"the index of {object_id} has no whole copy: restore a backup, or remove {folder.uri} and run again"


def _problem(location: Location, object_id: str) -> StoreError | None:
    """Return why the index cannot be read, None if it can.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    try:
        repository = ObjectRepository.open(location, object_id, create=False)
        repository.history()
    except StoreUnreachable:
        raise
    except StoreError as error:
        return error
    return None


def _edits_problem(location: Location, object_id: str) -> DamagedError | None:
    """Return why the history of edits cannot be read, None if it can; results do not depend on it."""
    try:
        Edits.open(location, object_id, create=False).history()
    except DamagedError as error:
        return error
    return None


def _reset_work(location: Location, object_id: str) -> bool:
    """Set the branch `work` to the newest version if its own snapshot cannot be read; return whether that helped."""
    try:
        repository = open_repository(repository_folder(location, object_id))
        with suppress(icechunk.IcechunkError, DamagedError):
            read_session(repository, object_id, "work")
            return False
        names = version_names(repository, object_id)
        if not names:
            return False
        newest = repository.lookup_tag(names[-1])
        read_session(repository, object_id, newest)
        repository.reset_branch("work", newest)
        read_session(repository, object_id, "work")
    except (icechunk.IcechunkError, DamagedError, StoreError):
        return False
    return _problem(location, object_id) is None
