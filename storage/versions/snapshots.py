"""Branches, tags and snapshots of an object's icechunk repository: the versions that they hold."""

import json
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any
from weakref import WeakKeyDictionary

import icechunk
from zarr.core.sync import sync

from glint.storage.errors import DamagedError, StoreError, damaged, one_line
from glint.storage.locations.error_translation import UNKNOWN_CAUSE_REMEDY, store_errors, translate
from glint.storage.seals import is_sealed
from glint.storage.versions.stage_results import WHOLE_OBJECT, EarlierKeys, Keys, StageResult
from glint.storage.versions.stages.reader import read_capture

PANICS = "PanicException", "RustPanic"  # where the library stops in a call and in a coroutine; not to be imported

_checked: WeakKeyDictionary[icechunk.Repository, set[str]] = WeakKeyDictionary()
"""Snapshots whose files were compared with their names, by open repository: listing a large one takes milliseconds."""


@dataclass(frozen=True, slots=True)
class Version:
    """A published version.

    metadata: as given by the publisher
    stages: keys of its content by capture and stage
    rolled_back: keys of the results from which rollbacks led to this content; publishing these again has no effect
    seals: checksums of its content by capture and stage
    created: False if publishing found nothing new
    """

    name: str
    snapshot: str
    time: datetime
    message: str
    metadata: dict[str, Any] = field(default_factory=dict)
    stages: Keys = field(default_factory=dict)
    rolled_back: EarlierKeys = field(default_factory=dict)
    seals: Keys = field(default_factory=dict)
    created: bool = True

    @property
    def captures(self) -> tuple[str, ...]:
        """The captures of its content, without WHOLE_OBJECT."""
        return tuple(name for name in self.stages if name != WHOLE_OBJECT)


def read_session(repository: icechunk.Repository, object_id: str, ref: str) -> icechunk.Session:
    """Open a read-only session at a branch, a version's name or a snapshot's id.

    Raises:
        StoreError: the repository has no such branch, version or snapshot; DamagedError: another lies in its place.
    """
    kind = "branch" if ref in ("main", "work") else "tag" if re.fullmatch(r"v\d+", ref) else "snapshot_id"
    try:
        session = repository.readonly_session(**{kind: ref})
    except (icechunk.RefNotFoundError, icechunk.InvalidInputError, ValueError) as error:
        raise StoreError(f"no version {ref!r} in this repository", "see `glint history`") from error
    _check_place(repository, object_id, session.snapshot_id)
    return session


def _check_place(repository: icechunk.Repository, object_id: str, snapshot_id: str) -> None:
    """Raise DamagedError if a snapshot's file is another's: the library does not look, and `work` has no seals."""
    checked = _checked.setdefault(repository, set())
    # `inspect_snapshot` waits with the interpreter's lock held: where other threads read, it deadlocks.
    if snapshot_id not in checked and sync(repository.inspect_snapshot_async(snapshot_id))["id"] != snapshot_id:
        raise index_damage("", object_id, f"another snapshot lies in the place of {snapshot_id}")
    checked.add(snapshot_id)


def version_names(repository: icechunk.Repository, object_id: str) -> list[str]:
    """Return v1, v2, .. in order.

    Raises:
        DamagedError: one is missing between two others, or the newest one.
    """
    numbers = sorted(int(tag[1:]) for tag in repository.list_tags() if re.fullmatch(r"v[1-9]\d*", tag))
    names = [f"v{number}" for number in numbers]
    newest, main = numbers[-1] if numbers else 0, repository.lookup_branch("main")
    # The branch `main` is never ahead of the newest tag, only behind it where a publisher died.
    if not numbers or repository.lookup_tag(names[-1]) != main:
        version = version_of(repository, object_id, main)
        newest = max(newest, int(version.name[1:]) if version else 0)
    absent = set(range(numbers[0] if numbers else 1, newest + 1)) - set(numbers)
    if absent:
        raise index_damage("", object_id, f"it has lost the version v{min(absent)}")
    return names


def read_version(repository: icechunk.Repository, object_id: str, name: str) -> Version:
    """Return the version from its tag and its commit's metadata.

    Raises:
        DamagedError: this is not what was written.
    """
    version = version_of(repository, object_id, repository.lookup_tag(name))
    if version is None:
        raise index_damage("", object_id, f"its {name} is not a version")
    if version.name != name:
        raise index_damage("", object_id, f"its {name} is {version.name}")
    return version


def version_at(repository: icechunk.Repository, object_id: str, ref: str) -> Version | None:
    """Return the version that a branch, name or snapshot is, None if it is none; `work` never is."""
    if ref == "work":
        return None
    return version_of(repository, object_id, read_session(repository, object_id, ref).snapshot_id)


def version_of(repository: icechunk.Repository, object_id: str, snapshot_id: str) -> Version | None:
    """Return the version that a snapshot is, None for a snapshot of another kind.

    Raises:
        DamagedError: its record is not what was written.
    """
    snapshot = repository.lookup_snapshot(snapshot_id)
    # The library gives the keys in any order.
    record: dict[str, Any] = json.loads(json.dumps(snapshot.metadata, sort_keys=True))
    if "version" not in record:
        return None
    name = record["version"] if is_sealed(record) else "a version"
    if not is_sealed(record) or record.get("object") != object_id or snapshot.id != snapshot_id:
        raise damaged(f"the record of {name} of {object_id}", "it is not what was written", object_id)
    try:
        return _version(record, snapshot.id)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        # A seal proves that a record is whole, not that Glint wrote it.
        problem = f"it is not as Glint writes it: {type(error).__name__} {one_line(error)}"
        raise damaged(f"the record of {name} of {object_id}", problem, object_id) from error


def _version(record: Mapping[str, Any], snapshot: str) -> Version:
    # Earlier records have those of the last rollback alone, not in a list.
    rolled_back = {name: keys if isinstance(keys, list) else [keys] for name, keys in record["rolled_back"].items()}
    return Version(
        name=str(record["version"]),
        snapshot=snapshot,
        time=datetime.fromisoformat(record["time"]),
        message=str(record["message"]),
        metadata=dict(record["metadata"]),
        stages={capture: dict(keys) for capture, keys in record["stages"].items()},
        rolled_back={capture: [dict(keys) for keys in earlier] for capture, earlier in rolled_back.items()},
        seals={capture: dict(seals) for capture, seals in record["seals"].items()},
    )


def version_results(
    repository: icechunk.Repository,
    object_id: str,
    version: Version,
    capture: str,
    stages: Collection[str] | None = None,
) -> dict[str, StageResult]:
    """Return the results of a capture of a version by stage, or those of some of its stages that it has.

    Raises:
        DamagedError: one is damaged, missing or another.
    """
    seals = version.seals.get(capture, {})
    chosen = {stage: seal for stage, seal in seals.items() if stages is None or stage in stages}
    store = read_session(repository, object_id, version.snapshot).store
    return read_capture(store, object_id, capture, version.name, chosen)


@contextmanager
def index_errors(uri: str, action: str, object_id: str) -> Iterator[None]:
    """Raise errors of the store as StoreError that names the action, those of a damaged index as DamagedError.

    Conflicts between writers pass unchanged, for the caller to try again.
    """
    try:
        with store_errors(uri, action):
            try:
                yield
            except icechunk.IcechunkError as error:
                # Numbers in the text about a damaged file may look like another cause.
                remedy = "" if "Invalid Icechunk" in str(error) else translate(uri, action, error).remedy
                if isinstance(error, icechunk.ConflictError) or remedy not in ("", UNKNOWN_CAUSE_REMEDY):
                    raise
                raise index_damage(uri, object_id, f"{action}: {one_line(error)}") from error
    except BaseException as error:
        # The library ends so where it trusts the content of a damaged file.
        if type(error).__name__ not in PANICS:
            raise
        raise index_damage(uri, object_id, f"{action}: {one_line(error)}") from error


def index_damage(uri: str, object_id: str, problem: str) -> DamagedError:
    """Return the error for an object whose index or snapshots are damaged; uri: of the store, if known."""
    return damaged(f"the index of object {object_id}{f' in {uri}' if uri else ''}", problem, object_id)


def find_version(repository: icechunk.Repository, object_id: str, name: str | None) -> Version:
    """Return the named version, or the newest one.

    Raises:
        StoreError: there is none.
    """
    names = version_names(repository, object_id)
    if not names or (name is not None and name not in names):
        absence = "no version yet" if not names else f"no version {name!r} (it has {', '.join(names)})"
        raise StoreError(f"{object_id} has {absence}", "see `glint history` or run the object")
    return read_version(repository, object_id, name or names[-1])


def newest_version(repository: icechunk.Repository, object_id: str) -> Version | None:
    """Return the newest version, or None before the first."""
    names = version_names(repository, object_id)
    return read_version(repository, object_id, names[-1]) if names else None
