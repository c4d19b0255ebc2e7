"""Checksums of the chunks of shards, kept in the attributes of their cache: what is read is what was written there.

Each chunk ends with its own checksum (CRC-32C), which zarr compares with the chunk's bytes. The attributes list these
checksums by array, shard and chunk, so that a whole shard in another's place is noticed too.
"""

from base64 import b64decode, b64encode
from collections.abc import AsyncIterator, Mapping, Sequence
from typing import Any

import numpy as np
from zarr.abc.store import ByteRequest, RangeByteRequest, Store
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import WrapperStore

CHECKSUM_BYTES = 4
"""Of a CRC-32C, at the end of a chunk and of the index at the end of a shard."""
_INDEX_ENTRY = np.dtype("<u8")
_CHECKSUM = np.dtype("<u4")
_CHUNKS = "c"


class ShardDamage(ValueError):
    """A shard does not hold the chunks that were written to it."""


class ShardStore(WrapperStore[Store]):
    """A store that notes the checksums of the chunks of each shard that is written, and verifies what is read.

    chunks: number of chunks of a shard by array; checksums: base64 of uint32 (chunks,) by the key of the shard.
    """

    def __init__(self, store: Store, chunks: Mapping[str, int], checksums: Mapping[str, str]) -> None:
        super().__init__(store)
        self._chunks, self.checksums = chunks, dict(checksums)
        self._offsets: dict[str, dict[int, int]] = {}

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return what `get` does, without an event loop.

        Raises:
            ShardDamage: it is not what was written.
        """
        if self._is_uncounted(key):
            return None
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
        """Write a value; of a shard, note the checksums of its chunks."""
        await self._store.set(key, value)
        self._note(key, value)

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return a value or a part of it; of a shard a chunk, the index, or all.

        For a writer, a shard without checksums is none: an earlier writer left it, uncounted.

        Raises:
            ShardDamage: it is not what was written.
        """
        if self._is_uncounted(key):
            return None
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
        return not self.read_only and f"/{_CHUNKS}/" in key and key not in self.checksums

    def _note(self, key: str, value: Buffer) -> None:
        if f"/{_CHUNKS}/" not in key:
            return
        shard = value.as_numpy_array().view(np.uint8)
        _, ends = _bounds(shard, self._chunks[key.partition("/")[0]])
        self.checksums[key] = b64encode(_ends_of(shard, ends).tobytes()).decode()

    def _check(self, key: str, byte_range: ByteRequest | None, value: Buffer | None) -> None:
        if f"/{_CHUNKS}/" not in key or value is None:
            return
        if key not in self.checksums:
            raise ShardDamage(f"{key} was never written")
        expected = np.frombuffer(b64decode(self.checksums[key]), _CHECKSUM)
        data = value.as_numpy_array().view(np.uint8)
        if isinstance(byte_range, RangeByteRequest):
            number, ends = self._offsets.get(key, {}).get(byte_range.start), np.array([len(data)])
            if number is None or _ends_of(data, ends)[0] != expected[number]:
                raise ShardDamage(f"{key} holds another chunk than was written")
            return
        starts, ends = _bounds(data, len(expected))
        self._offsets[key] = {int(start): number for number, start in enumerate(starts)}
        if byte_range is None and not np.array_equal(_ends_of(data, ends), expected):
            raise ShardDamage(f"{key} holds other chunks than were written")


def _bounds(data: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return first byte and end (count,) of the chunks in a shard, from the index at the end of `data`, uint8 (n,)."""
    size = count * 2 * _INDEX_ENTRY.itemsize
    if len(data) < size + CHECKSUM_BYTES:
        raise ShardDamage("a shard is truncated")
    index = np.frombuffer(data[len(data) - size - CHECKSUM_BYTES : len(data) - CHECKSUM_BYTES].tobytes(), _INDEX_ENTRY)
    return index[::2], index[::2] + index[1::2]


def _ends_of(data: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the last four bytes before each of `ends` (n,) in `data`, uint8 (bytes,), as uint32 (n,)."""
    if len(ends) == 0 or ends.max() > len(data) or ends.min() < CHECKSUM_BYTES:
        raise ShardDamage("the index of a shard is damaged")
    places = ends.astype(np.int64)[:, None] + np.arange(-CHECKSUM_BYTES, 0)
    return np.ascontiguousarray(data[places]).view(_CHECKSUM)[:, 0]
