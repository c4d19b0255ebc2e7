"""Checksums from end to end: of all bytes of a stage's group, kept in its attributes, which carry one of themselves.

A stage's attributes list the checksum of every key of its group: of the metadata of its arrays, and of their chunks as
they are stored. They also name object, capture and stage, and are sealed: one checksum over all of it. So whatever
happens to a file of the store (chunks, icechunk's manifests, snapshots and index, two files that change places), what
is read is what was written, or an error.
"""

import hashlib
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping, Sequence

import icechunk
import zarr
from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest
from zarr.core.buffer import Buffer, BufferPrototype, default_buffer_prototype
from zarr.storage import WrapperStore

from glint.storage.errors import DamagedError, StoreError, damaged, one_line
from glint.storage.locations.error_translation import UNKNOWN_CAUSE_REMEDY, translate
from glint.storage.locations.location import METADATA_FILE
from glint.storage.seals import HEX_DIGITS
from glint.storage.versions.stages.groups import readable_metadata

FILES_GROUP = "files"
"""Name of the subgroup of a stage's files; no array can have this name."""

_FILES_START, _METADATA_END = f"{FILES_GROUP}/", f"/{METADATA_FILE}"


def checksum(data: bytes | memoryview) -> str:
    """Return the checksum of bytes."""
    return hashlib.sha256(data).hexdigest()[:HEX_DIGITS]


class RecordingStore(WrapperStore[Store]):
    """A store that notes the checksum of everything that is written to it, by key."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.checksums: dict[str, str] = {}

    async def set(self, key: str, value: Buffer) -> None:
        """Write a value, and note its checksum."""
        await self._store.set(key, value)
        self.checksums[key] = checksum(memoryview(value.as_numpy_array()))

    async def delete(self, key: str) -> None:
        """Remove a value, and its checksum."""
        await self._store.delete(key)
        self.checksums.pop(key, None)


class VerifiedStore(WrapperStore[Store]):
    """A store that serves the values of a table of checksums, each verified.

    checksums: by key below `prefix`; owner: object, capture, stage and version, for messages.
    """

    def __init__(self, store: Store, prefix: str, checksums: Mapping[str, str], owner: str, object_id: str) -> None:
        super().__init__(store)
        self._prefix, self._checksums, self._owner, self.object_id = prefix, checksums, owner, object_id

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return a value; None for a key without a checksum and a value, such as that of a chunk of fill values.

        Raises:
            DamagedError: the value is not what was written.
            StoreUnreachable: the store does not answer.
        """
        name = key.removeprefix(f"{self._prefix}/")
        expected = self._checksums.get(name)
        try:
            value = await self._store.get(key, prototype)
        except Exception as error:
            raise self._error(name, error) from error
        if value is None and expected is None:
            return None
        if value is None:
            raise self._damage(name, "is missing")
        if expected is None:
            raise self._damage(name, "was never written")
        if checksum(memoryview(value.as_numpy_array())) != expected:
            raise self._damage(name, "does not match its checksum")
        return value if byte_range is None else value[_slice_of(byte_range, len(value))]

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Return parts of values, each of a verified value."""
        return [await self.get(key, prototype, byte_range) for key, byte_range in key_ranges]

    async def get_ranges(
        self, key: str, byte_ranges: Sequence[ByteRequest | None], *, prototype: BufferPrototype, **limits: int | None
    ) -> AsyncIterator[Sequence[tuple[int, Buffer | None]]]:
        """Yield parts of a value with their numbers, each of a verified value."""
        for number, byte_range in enumerate(byte_ranges):
            yield [(number, await self.get(key, prototype, byte_range))]

    def _error(self, name: str, error: Exception) -> StoreError:
        """Return what an error of the store itself means for a value."""
        translated = translate("the store", f"reading {name} of {self._owner}", error)
        if translated.remedy != UNKNOWN_CAUSE_REMEDY or not isinstance(error, icechunk.IcechunkError):
            return translated
        return self._damage(name, f"cannot be read: {one_line(error)}")

    def _damage(self, name: str, problem: str) -> DamagedError:
        parts = name.split("/")
        is_file = parts[0] == "files" and len(parts) > 2
        label = f"file {parts[1]!r}" if is_file else f"array {parts[0]!r}"
        return damaged(f"{label} of {self._owner}", f"{'/'.join(parts[1 + is_file :])} {problem}", self.object_id)


class VerifiedArrays(Mapping[str, zarr.Array]):
    """Arrays of a group by name, each opened at its first access."""

    def __init__(self, store: VerifiedStore, path: str, names: Iterable[str]) -> None:
        self._store, self._path, self._names, self._arrays = store, path, list(names), dict[str, zarr.Array]()

    def __getitem__(self, name: str) -> zarr.Array:
        """Return an array.

        Raises:
            KeyError: there is none; DamagedError: its metadata is damaged.
        """
        if name not in self._arrays:
            if name not in self._names:
                raise KeyError(name)
            path = f"{self._path}/{name}"
            with readable_metadata(self._store.object_id, path):
                self._arrays[name] = zarr.open_array(self._store, path=path, mode="r", zarr_format=3)
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return their number."""
        return len(self._names)


class VerifiedGroup:
    """The group of a stage, of which every value is verified as it is read.

    arrays: by name; file_arrays: those that hold the content of files, by the file's name; keys: of all values.
    """

    def __init__(self, store: Store, path: str, checksums: Mapping[str, str], owner: str, object_id: str) -> None:
        self._store = VerifiedStore(store, path, checksums, owner, object_id)
        self.keys = tuple(f"{path}/{name}" for name in checksums)
        places = [name.removesuffix(_METADATA_END) for name in checksums if name.endswith(_METADATA_END)]
        files = [place.removeprefix(_FILES_START) for place in places if place.startswith(_FILES_START)]
        arrays = [place for place in places if "/" not in place and place != FILES_GROUP]
        self.arrays = VerifiedArrays(self._store, path, arrays)
        self.file_arrays = VerifiedArrays(self._store, f"{path}/{FILES_GROUP}", files)

    async def size_of(self, key: str) -> int:
        """Read the value of a key; return its size in bytes.

        Raises:
            DamagedError: the value is not what was written; StoreUnreachable: the store does not answer.
        """
        value = await self._store.get(key, default_buffer_prototype())
        return 0 if value is None else len(value)


def _slice_of(byte_range: ByteRequest, size: int) -> slice:
    match byte_range:
        case RangeByteRequest(start, end):
            return slice(start, end)
        case OffsetByteRequest(offset):
            return slice(offset, size)
        case SuffixByteRequest(suffix):
            return slice(max(0, size - suffix), size)
