"""Publication: making a version of results on the branch `work`, or of an older version.

A version is a commit on a temporary branch that started from `work`, so saving is not disturbed. Its tag makes it a
version; the branch `main` follows. All functions may be called again after a conflict with another writer.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import icechunk
import zarr

from glint.storage.errors import DamagedError, StoreError
from glint.storage.json_values import json_value
from glint.storage.seals import SEAL, sealed
from glint.storage.versions.array_schema import VersionSchema, schema_violations
from glint.storage.versions.garbage import new_branch_name
from glint.storage.versions.snapshots import (
    Version,
    newest_version,
    read_session,
    read_version,
    version_results,
)
from glint.storage.versions.stage_results import WHOLE_OBJECT, EarlierKeys, Keys, StoredFile
from glint.storage.versions.stages.groups import LAYOUT_NUMBER
from glint.storage.versions.stages.reader import contents, read_capture, stage_attributes, stage_keys
from glint.storage.versions.stages.writer import write_stage
from glint.storage.versions.verification import verify


def publish(
    repository: icechunk.Repository,
    object_id: str,
    captures: Sequence[str],
    schema: VersionSchema,
    *,
    metadata: Mapping[str, Any],
    message: str,
    removed: Collection[str],
) -> Version:
    """Make a version with the named captures' results on `work`; see `ObjectRepository.publish`.

    Raises:
        StoreError: a result is missing or malformed.
        icechunk.ConflictError: another publisher was faster.
    """
    current = repair_main(repository, object_id)
    base = repository.lookup_branch("work")
    work = read_session(repository, object_id, base).store
    keys = {capture: stage_keys(work, object_id, capture) for capture in captures}
    published, rolled_back = (current.stages, current.rolled_back) if current else ({}, {})
    new = {
        capture: stages
        for capture, stages in keys.items()
        if stages != published.get(capture) and stages not in rolled_back.get(capture, ())
    }
    if current:
        new |= _replacements(repository, object_id, current, {name: keys[name] for name in keys.keys() - new.keys()})
    if current and not new and not published.keys() & set(removed):
        return replace(current, created=False)
    for capture in new:
        _check_capture(work, object_id, capture, schema)
    kept = {capture: stages for capture, stages in published.items() if capture not in new and capture not in removed}
    if not new and not kept:
        raise StoreError(f"{object_id} has nothing to publish", "name at least one capture")
    version = next_version(
        current,
        stages=kept | new,
        rolled_back={capture: stages for capture, stages in rolled_back.items() if capture not in new},
        metadata=metadata,
        message=message,
    )
    return commit_version(repository, object_id, base, current, version, kept)


def rollback(repository: icechunk.Repository, object_id: str, target: Version, message: str) -> Version:
    """Make a version with the content of `target`; return the current one if it has this content, undamaged, already.

    Raises:
        icechunk.ConflictError: another publisher was faster.
    """
    current = repair_main(repository, object_id)
    if current is None or target.snapshot == current.snapshot:
        return replace(target, created=False)
    is_same = (current.stages, current.seals) == (target.stages, target.seals)
    if is_same and all(is_whole(repository, object_id, current, capture) for capture in current.stages):
        return replace(current, created=False)
    version = next_version(
        current,
        stages=target.stages,
        rolled_back=_rolled_back(current, target),
        metadata=target.metadata | {"rolled_back_to": target.name, "replaces": current.name},
        message=message or f"roll back from {current.name} to {target.name}",
    )
    return commit_version(repository, object_id, target.snapshot, current, version, {})


def is_whole(repository: icechunk.Repository, object_id: str, version: Version, capture: str) -> bool:
    """Return whether all bytes of a capture of a version are what was written."""
    try:
        results = version_results(repository, object_id, version, capture)
    except DamagedError:
        return False
    return not verify(results.values()).damages


def published(repository: icechunk.Repository, object_id: str, keys: Keys) -> Version | None:
    """Return the newest version if publishing results with these keys would change nothing, else None."""
    newest = newest_version(repository, object_id)
    if newest is None or repository.lookup_branch("main") != newest.snapshot:
        return None
    is_same = all(
        stages in (newest.stages.get(capture), *newest.rolled_back.get(capture, ())) for capture, stages in keys.items()
    )
    return replace(newest, created=False) if is_same else None


def repair_main(repository: icechunk.Repository, object_id: str) -> Version | None:
    """Return the newest version; move `main` there if its publisher died before it could."""
    newest = newest_version(repository, object_id)
    if newest is None:
        return None
    main = repository.lookup_branch("main")
    if main != newest.snapshot:
        try:
            repository.reset_branch("main", newest.snapshot, from_snapshot_id=main)
        except icechunk.ConflictError:
            return repair_main(repository, object_id)
    return newest


def next_version(
    current: Version | None, stages: Keys, rolled_back: EarlierKeys, metadata: Mapping[str, Any], message: str
) -> Version:
    """Return the version that follows `current`, without a snapshot yet."""
    name = f"v{int(current.name[1:]) + 1 if current else 1}"
    return Version(name, "", datetime.now(UTC), message or f"version {name}", json_value(metadata), stages, rolled_back)


def commit_version(
    repository: icechunk.Repository, object_id: str, base: str, current: Version | None, version: Version, kept: Keys
) -> Version:
    """Commit exactly `version.stages`, starting from snapshot `base`, and tag the commit.

    kept: the part of `version.stages` that is copied from `current` where `base` differs.

    Raises:
        icechunk.ConflictError: another publisher took the name first.
    """
    branch = new_branch_name()
    repository.create_branch(branch, base)
    try:
        writable = repository.writable_session(branch)
        root = zarr.open_group(writable.store, mode="a", use_consolidated=False)
        present = contents(writable.store, object_id)
        for capture in present.keys() - version.stages.keys():
            del root[capture]
        for capture in kept:
            if current is not None and present.get(capture) != kept[capture]:
                _copy_capture(repository, object_id, writable.store, current, capture)
        own = {"layout": LAYOUT_NUMBER, "object": object_id, "version": version.name}
        root.attrs.put(sealed(own | {"metadata": version.metadata}))
        record = sealed(_version_record(writable.store, object_id, version))
        repository.create_tag(version.name, writable.commit(version.message, record))
    except icechunk.AlreadyExistsError as error:
        raise icechunk.ConflictError() from error
    finally:
        repository.delete_branch(branch)
    # From the tag on the version exists; if this process dies here, the next publisher moves `main`.
    repair_main(repository, object_id)
    return read_version(repository, object_id, version.name)


def _version_record(store: Any, object_id: str, version: Version) -> dict[str, Any]:
    """Return what the commit of a version says of it, with the seals of its content in `store`."""
    attributes = {capture: stage_attributes(store, object_id, capture) for capture in version.stages}
    return {
        "version": version.name,
        "object": object_id,
        "time": version.time.isoformat(),
        "message": version.message,
        "stages": version.stages,
        "seals": {name: {stage: own[SEAL] for stage, own in stages.items()} for name, stages in attributes.items()},
        "rolled_back": version.rolled_back,
        "metadata": version.metadata,
    }


def _rolled_back(current: Version, target: Version) -> EarlierKeys:
    """Return the results from which this rollback and those before it lead to `target`; `work` may hold any of them."""
    rolled_back = {}
    for capture in current.stages | current.rolled_back:
        earlier = [*current.rolled_back.get(capture, ()), current.stages.get(capture)]
        rolled_back[capture] = [keys for keys in earlier if keys and keys != target.stages.get(capture)]
    return {capture: earlier for capture, earlier in rolled_back.items() if earlier}


def _replacements(repository: icechunk.Repository, object_id: str, current: Version, keys: Keys) -> Keys:
    """Return those of the keys, of captures with nothing new, whose capture is damaged in `current`.

    Raises:
        StoreError: such a capture was rolled back to other results, which these keys do not give again.
    """
    lost = {
        capture: stages
        for capture, stages in keys.items()
        if capture in current.stages and not is_whole(repository, object_id, current, capture)
    }
    for capture, stages in lost.items():
        if stages != current.stages[capture]:
            raise StoreError(
                f"{object_id}/{capture} is damaged in {current.name}, which was rolled back to other results",
                f"`glint rollback {object_id} VERSION` to a version that is whole, or restore a backup",
            )
    return lost


def _check_capture(store: Any, object_id: str, capture: str, schema: VersionSchema) -> None:
    results = read_capture(store, object_id, capture)
    violations = schema_violations(results, schema.arrays, () if capture == WHOLE_OBJECT else schema.stages)
    if violations or not results:
        raise StoreError(
            f"{object_id}/{capture} cannot be published: {'; '.join(violations) or 'it has no result'}",
            "run the capture again",
        )


def _copy_capture(repository: icechunk.Repository, object_id: str, store: Any, current: Version, capture: str) -> None:
    """Replace the capture in `store` by its state in `current`."""
    root = zarr.open_group(store, mode="a", use_consolidated=False)
    if capture in root:
        del root[capture]
    for stage, result in version_results(repository, object_id, current, capture).items():
        files = {name: StoredFile(result.read_file(name), info.media_type) for name, info in result.files.items()}
        arrays, record = result.arrays, result.record
        write_stage(store, object_id, capture, stage, result.key, arrays=arrays, record=record, files=files)
