"""The indices of shards, kept in the attributes of their cache: what is read is what was written there.

Each chunk ends with its own checksum (CRC-32C), which zarr compares with the chunk's bytes. The attributes list place
and checksum of each chunk by array and shard, so that a whole shard in another's place is noticed too, and so that a
shard's index, which is at its end, is not read: a request less for each part of it.
"""

from base64 import b64decode, b64encode
from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Any

import numpy as np
from zarr.abc.store import ByteRequest, RangeByteRequest, Store, SuffixByteRequest
from zarr.core.buffer import Buffer, BufferPrototype, default_buffer_prototype
from zarr.storage import WrapperStore

CHECKSUM_BYTES = 4
"""Size of a CRC-32C, at the end of a chunk and of the index at the end of a shard."""
_INDEX_ENTRY = np.dtype("<u8")
_WORD = np.dtype("<u4")
_CHUNKS = "c"


class ShardDamage(ValueError):
    """A shard does not hold the chunks that were written to it."""


class ShardStore(WrapperStore[Store]):
    """A store that notes the index of each shard that is written, and verifies what is read.

    chunks: number of chunks of a shard by array; indices: by the key of the shard, base64 of uint32 (3 chunks + 1,):
    first bytes, sizes and checksums of its chunks, and the checksum of the index.
    """

    def __init__(self, store: Store, chunks: Mapping[str, int], indices: Mapping[str, str]) -> None:
        super().__init__(store)
        self._chunks, self.indices = chunks, dict(indices)

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return what `get` does, without an event loop.

        Raises:
            ShardDamage: it is not what was written.
        """
        if self._is_uncounted(key):
            return None
        if _is_shard(key) and isinstance(byte_range, SuffixByteRequest):
            return self._index(key, prototype or default_buffer_prototype())
        value = super().get_sync(key, prototype=prototype, byte_range=byte_range)
        self._check(key, byte_range, value)
        return value

    def set_sync(self, key: str, value: Buffer) -> None:
        """Write what `set` does, without an event loop."""
        super().set_sync(key, value)
        self._note(key, value)

    def get_ranges_sync(
        self, key: str, byte_ranges: Sequence[ByteRequest | None], *, prototype: BufferPrototype, **limits: Any
    ) -> Sequence[tuple[int, Buffer | None]]:
        """Return chunks of a shard with their numbers in `byte_ranges`, each verified."""
        values = self._store.get_ranges_sync(key, byte_ranges, prototype=prototype, **limits)
        for number, value in values:
            self._check(key, byte_ranges[number], value)
        return values

    async def set(self, key: str, value: Buffer) -> None:
        """Write a value; of a shard, note its index."""
        await self._store.set(key, value)
        self._note(key, value)

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return a value or a part of it; of a shard a chunk, the index, or all.

        For a writer, a shard without an index is none: an earlier writer left it, uncounted.

        Raises:
            ShardDamage: it is not what was written.
        """
        if self._is_uncounted(key):
            return None
        if _is_shard(key) and isinstance(byte_range, SuffixByteRequest):
            return self._index(key, prototype)
        value = await self._store.get(key, prototype, byte_range)
        self._check(key, byte_range, value)
        return value

    async def get_ranges(
        self, key: str, byte_ranges: Sequence[ByteRequest | None], *, prototype: BufferPrototype, **limits: Any
    ) -> AsyncIterator[Sequence[tuple[int, Buffer | None]]]:
        """Yield chunks of a shard with their numbers in `byte_ranges`, each verified."""
        given = {name: limit for name, limit in limits.items() if limit is not None}
        async for group in self._store.get_ranges(key, byte_ranges, prototype=prototype, **given):
            for number, value in group:
                self._check(key, byte_ranges[number], value)
            yield group

    def _is_uncounted(self, key: str) -> bool:
        """Return whether a key is, for a writer, that of a shard which an earlier one left uncounted."""
        return not self.read_only and _is_shard(key) and key not in self.indices

    def _note(self, key: str, value: Buffer) -> None:
        if _is_shard(key):
            starts, sizes, checksum = _read_index(value, self._chunks[key.partition("/")[0]])
            ends = _ends_of(value.as_numpy_array().view(np.uint8), starts + sizes)
            noted = np.concatenate([starts, sizes, ends, [checksum]]).astype(_WORD)
            self.indices[key] = b64encode(noted.tobytes()).decode()

    def _noted(self, key: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return first bytes, sizes and checksums (chunks,) uint32 of a shard's chunks, and (1,) that of its index."""
        if key not in self.indices:
            raise ShardDamage(f"{key} was never written")
        noted = np.frombuffer(b64decode(self.indices[key]), _WORD)
        count = self._chunks[key.partition("/")[0]]
        if len(noted) != 3 * count + 1:
            raise ShardDamage(f"the index of {key} is damaged")
        return noted[:count], noted[count : 2 * count], noted[2 * count : -1], noted[-1:]

    def _index(self, key: str, prototype: BufferPrototype) -> Buffer:
        """Return the bytes at the end of a shard that say where its chunks are."""
        starts, sizes, _, checksum = self._noted(key)
        entries = np.stack([starts, sizes], axis=-1).astype(_INDEX_ENTRY)
        return prototype.buffer.from_bytes(entries.tobytes() + checksum.tobytes())

    def _check(self, key: str, byte_range: ByteRequest | None, value: Buffer | None) -> None:
        if not _is_shard(key) or value is None:
            return
        starts, sizes, checksums, _ = self._noted(key)
        data = value.as_numpy_array().view(np.uint8)
        if not isinstance(byte_range, RangeByteRequest):
            if not np.array_equal(_ends_of(data, starts.astype(np.int64) + sizes), checksums):
                raise ShardDamage(f"{key} holds other chunks than were written")
            return
        number = np.flatnonzero(starts == byte_range.start)
        if len(number) != 1 or _ends_of(data, np.array([len(data)]))[0] != checksums[number[0]]:
            raise ShardDamage(f"{key} holds another chunk than was written")


def _is_shard(key: str) -> bool:
    return f"/{_CHUNKS}/" in key


def _read_index(value: Buffer, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Return first bytes and sizes (count,) of the chunks in a shard, and the checksum at the end of its index."""
    data = value.as_numpy_array().view(np.uint8)
    size = count * 2 * _INDEX_ENTRY.itemsize
    if len(data) < size + CHECKSUM_BYTES:
        raise ShardDamage("a shard is truncated")
    index = np.frombuffer(data[len(data) - size - CHECKSUM_BYTES : len(data) - CHECKSUM_BYTES].tobytes(), _INDEX_ENTRY)
    return index[::2], index[1::2], int(np.frombuffer(data[-CHECKSUM_BYTES:].tobytes(), _WORD)[0])


def _ends_of(data: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the last four bytes before each of `ends` (n,) in `data`, uint8 (bytes,), as uint32 (n,)."""
    if len(ends) == 0 or ends.max() > len(data) or ends.min() < CHECKSUM_BYTES:
        raise ShardDamage("the index of a shard is damaged")
    places = ends.astype(np.int64)[:, None] + np.arange(-CHECKSUM_BYTES, 0)
    return np.ascontiguousarray(data[places]).view(_WORD)[:, 0]
