"""Opening of an object's icechunk repository, and creating it where it is absent."""

from contextlib import suppress

import icechunk
import obstore

from glint.storage.errors import damaged
from glint.storage.locations.location import Location

_NO_PRELOAD = icechunk.ManifestPreloadConfig(
    max_total_refs=0, max_arrays_to_scan=0, preload_if=icechunk.ManifestPreloadCondition.false()
)
CONFIG = icechunk.RepositoryConfig(
    # By default the cache of snapshots takes a hundred megabytes for each open object; only the newest are read again.
    caching=icechunk.CachingConfig(num_snapshot_nodes=10_000, num_chunk_refs=100_000),
    # By default every session reads the manifests of all small arrays in advance, which takes twenty times as long as
    # the attributes that most sessions are opened for.
    manifest=icechunk.ManifestConfig(preload=_NO_PRELOAD),
)
"""What a process keeps in memory, and what a session reads in advance."""


def open_repository(location: Location) -> icechunk.Repository:
    """Open an existing repository.

    Raises:
        RepositoryNotFoundError: there is none.
    """
    return icechunk.Repository.open(location.icechunk_storage(), config=CONFIG)


def open_existing(location: Location, object_id: str) -> icechunk.Repository | None:
    """Open a repository; None if there is none.

    Raises:
        DamagedError: its index is missing.
    """
    try:
        return open_repository(location)
    except icechunk.RepositoryNotFoundError as error:
        if _lists_snapshots(location):
            index = f"the index of object {object_id} in {location.uri}"
            raise damaged(index, "its file `repo` is lost", object_id) from error
        return None


def open_or_create(location: Location, object_id: str) -> icechunk.Repository:
    """Open the repository and its branch `work`; create what is missing, also after an interrupted creation.

    Raises:
        DamagedError: there are results but no index of them.
    """
    repository = open_existing(location, object_id)
    if repository is None:
        with suppress(icechunk.ConflictError):
            icechunk.Repository.create(location.icechunk_storage(), check_clean_root=False)
        repository = open_repository(location)
    if "work" not in repository.list_branches():
        with suppress(icechunk.AlreadyExistsError, icechunk.ConflictError):
            repository.create_branch("work", repository.lookup_branch("main"))
    return repository


def _lists_snapshots(location: Location) -> bool:
    """Return whether there are snapshots but the initial one, which an interrupted creation may leave."""
    if location.local is not None and not location.local.is_dir():
        return False
    return sum(len(batch) for batch in obstore.list(location.obstore(), prefix="snapshots")) > 1
