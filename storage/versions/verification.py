"""Verification of whole results: all bytes read and compared with their checksums, without being decoded."""

import asyncio
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import icechunk

from glint.storage.errors import DamagedError
from glint.storage.versions.stage_results import Keys, StageResult

if TYPE_CHECKING:
    from glint.storage.versions.repository import ObjectRepository

CONCURRENT_READS = 8
"""Values read at once; bounds the memory by as many chunks."""

EARLIER_VERSIONS = 8
"""Newest versions in which an earlier result is looked for: an edit is usually taken back within a few runs."""

_version_keys: WeakKeyDictionary[icechunk.Repository, dict[str, Keys]] = WeakKeyDictionary()
"""Stage keys of versions that were read, by open repository and snapshot."""


@dataclass(frozen=True, slots=True)
class Verification:
    """Result of a verification: numbers of values and bytes read, and the damage found."""

    values: int
    bytes: int
    damages: tuple[DamagedError, ...]


def verify(results: Iterable[StageResult]) -> Verification:
    """Read all bytes of results; damage is reported for each array and file once.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    # A thread of its own, since the caller's may have an event loop that runs.
    with ThreadPoolExecutor(1) as executor:
        parts = executor.submit(asyncio.run, _verify(list(results))).result()
    sizes = [part for part in parts if isinstance(part, int)]
    damages = {error.message.partition(" is damaged")[0]: error for error in parts if isinstance(error, DamagedError)}
    return Verification(len(parts), sum(sizes), tuple(damages.values()))


def verify_capture(repository: "ObjectRepository", capture: str, ref: str) -> Verification:
    """Read all bytes of a capture of a version, or of the newest results (`work`).

    Raises:
        StoreUnreachable: the store does not answer.
    """
    try:
        return verify(repository.load_capture(capture, ref).values())
    except DamagedError as error:
        return Verification(0, 0, (error,))


def whole_result(repository: "ObjectRepository", capture: str, stage: str, key: str) -> StageResult | None:
    """Return the stage's newest result if it was saved under this key and is whole, else None.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    try:
        if repository.stage_key(capture, stage) != key:
            return None
        result = repository.load(capture, stage)
    except DamagedError:
        return None
    return None if verify([result]).damages else result


def earlier_result(repository: "ObjectRepository", capture: str, stage: str, key: str) -> StageResult | None:
    """Return the stage's result of the newest version that holds it under this key, and whole; None where none does.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    for name in reversed(repository.version_names()[-EARLIER_VERSIONS:]):
        try:
            if _keys_of(repository, name).get(capture, {}).get(stage) != key:
                continue
            result = repository.load(capture, stage, name)
        except DamagedError:
            continue
        if not verify([result]).damages:
            return result
    return None


def _keys_of(repository: "ObjectRepository", name: str) -> Keys:
    """Return the stage keys of a version; of a large object they take a while to read."""
    known = _version_keys.setdefault(repository.index, {})
    snapshot = repository.index.lookup_tag(name)
    if snapshot not in known:
        known[snapshot] = repository.version(name).stages
    return known[snapshot]


async def _verify(results: list[StageResult]) -> list[int | DamagedError]:
    limit = asyncio.Semaphore(CONCURRENT_READS)

    async def read(result: StageResult, key: str) -> int | DamagedError:
        async with limit:
            try:
                return await result.group.size_of(key)
            except DamagedError as error:
                return error

    return list(await asyncio.gather(*(read(result, key) for result in results for key in result.group.keys)))
