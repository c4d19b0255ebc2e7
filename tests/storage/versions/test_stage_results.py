"""Groups that hold stages whose metadata is damaged."""

import asyncio

import pytest
import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.storage import MemoryStore

from glint.storage.errors import DamagedError
from glint.storage.versions import stage_results

METADATA = [
    b'{"attributes": {}, "zarr_format": 3, "c\x11\n_type": "group"}',
    b'{"attributes": {}, "zarr_format": 3, "node_tyqe": "group"}',
    b'{"attributes": 5, "zarr_format": 3, "node_type": "group"}',
    b'{"attributes": {}, "zarr_format": 3, "node_type": "groun"}',
    b"\xff\x00",
    b"[]",
]


@pytest.mark.parametrize("place", ["", "front/", "front/labels/"])
@pytest.mark.parametrize("metadata", METADATA)
def test_damaged_metadata_is_told(place: str, metadata: bytes) -> None:
    store = MemoryStore()
    zarr.open_group(store, path="front/labels", mode="w", zarr_format=3)
    asyncio.run(store.set(f"{place}zarr.json", default_buffer_prototype().buffer.from_bytes(metadata)))
    with pytest.raises(DamagedError, match="is damaged"):
        if place:
            stage_results.read_capture(store, "duck", "front", seals={"labels": "0"})
        else:
            stage_results.check_layout(store, "duck", "here")
