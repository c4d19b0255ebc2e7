"""A store that serves only what was written: values, parts of them, and what was never there."""

import asyncio

import pytest
from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, SuffixByteRequest
from zarr.core.buffer import Buffer, default_buffer_prototype
from zarr.storage import MemoryStore

from glint.storage.errors import DamagedError
from glint.storage.versions.stages.checksums import RecordingStore, VerifiedStore

PROTOTYPE = default_buffer_prototype()
WRITTEN = b"0123456789"
FILE_KEY, ARRAY_KEY = "front/mask/files/a.ply/c/0", "front/mask/mask/c/0/0"


def buffer(data: bytes) -> Buffer:
    return PROTOTYPE.buffer.from_bytes(data)


@pytest.fixture
def inner() -> MemoryStore:
    """A store in which two values of a stage were written, and one was removed again."""

    async def write() -> None:
        for key in (FILE_KEY, ARRAY_KEY, "front/mask/mask/c/0/1"):
            await store.set(key, buffer(WRITTEN))
        await store.delete("front/mask/mask/c/0/1")

    inner = MemoryStore()
    store = RecordingStore(inner)
    asyncio.run(write())
    assert store.checksums.keys() == {FILE_KEY, ARRAY_KEY}
    return inner


def read(inner: MemoryStore, key: str, byte_range: ByteRequest | None = None) -> bytes | None:
    recorded = RecordingStore(MemoryStore())
    asyncio.run(recorded.set("x", buffer(WRITTEN)))
    checksums = dict.fromkeys(("files/a.ply/c/0", "mask/c/0/0"), recorded.checksums["x"])
    store = VerifiedStore(inner, "front/mask", checksums, "duck/front/mask", "duck")
    value = asyncio.run(store.get(key, PROTOTYPE, byte_range))
    return None if value is None else value.to_bytes()


def test_what_was_written_is_served_whole_and_in_parts(inner: MemoryStore) -> None:
    assert read(inner, ARRAY_KEY) == read(inner, FILE_KEY) == WRITTEN
    assert read(inner, ARRAY_KEY, RangeByteRequest(2, 5)) == b"234"
    assert read(inner, ARRAY_KEY, OffsetByteRequest(7)) == b"789"
    assert read(inner, ARRAY_KEY, SuffixByteRequest(3)) == b"789"
    assert read(inner, ARRAY_KEY, SuffixByteRequest(12)) == WRITTEN
    assert read(inner, "front/mask/mask/c/9/9") is None, "a chunk of fill values"


@pytest.mark.parametrize(
    ("key", "data", "says"),
    [
        (ARRAY_KEY, b"0123456780", "array 'mask' of duck/front/mask is damaged (c/0/0 does not match its checksum)"),
        (ARRAY_KEY, None, "array 'mask' of duck/front/mask is damaged (c/0/0 is missing)"),
        (FILE_KEY, b"", "file 'a.ply' of duck/front/mask is damaged (c/0 does not match its checksum)"),
        ("front/mask/mask/c/0/1", WRITTEN, "array 'mask' of duck/front/mask is damaged (c/0/1 was never written)"),
    ],
)
def test_anything_else_is_damage(inner: MemoryStore, key: str, data: bytes | None, says: str) -> None:
    asyncio.run(inner.delete(key) if data is None else inner.set(key, buffer(data)))
    for byte_range in (None, RangeByteRequest(0, 1)):
        with pytest.raises(DamagedError) as caught:
            read(inner, key, byte_range)
        assert says in caught.value.message
