"""Groups that hold stages whose metadata is damaged."""

import asyncio

import numpy as np
import pytest
from zarr.core.buffer import default_buffer_prototype
from zarr.core.common import ZARR_JSON
from zarr.storage import MemoryStore

from glint.storage.catalogue.models import RESERVED_IDS
from glint.storage.errors import DamagedError, StoreError
from glint.storage.locations.location import METADATA_FILE
from glint.storage.versions import stage_results
from glint.storage.versions.stage_results import check_file_name, check_name
from glint.storage.versions.stage_writer import write_stage
from glint.storage.versions.verification import verify

METADATA = [
    b'{"attributes": {}, "zarr_format": 3, "c\x11\n_type": "group"}',
    b'{"attributes": {}, "zarr_format": 3, "node_tyqe": "group"}',
    b'{"attributes": 5, "zarr_format": 3, "node_type": "group"}',
    b'{"attributes": {}, "zarr_format": 3, "node_type": "groun"}',
    b"\xff\x00",
    b"[]",
]


def store_with(place: str, metadata: bytes) -> MemoryStore:
    """Return a store with the stages labels and depth of a capture, and other metadata of the group at `place`."""
    store = MemoryStore()
    for stage in ("labels", "depth"):
        write_stage(store, "duck", "front", stage, "key", arrays={"mask": np.ones((2, 2), bool)}, record={})
    asyncio.run(store.set(f"{place}zarr.json", default_buffer_prototype().buffer.from_bytes(metadata)))
    return store


@pytest.mark.parametrize("place", ["", "front/", "front/labels/"])
@pytest.mark.parametrize("metadata", METADATA)
def test_damaged_metadata_is_told(place: str, metadata: bytes) -> None:
    store = store_with(place, metadata)
    with pytest.raises(DamagedError) as caught:
        if place:
            with pytest.raises(DamagedError, match="duck/front"):
                stage_results.saved_key(store, "duck", "front", "labels")
            stage_results.read_capture(store, "duck", "front", seals={"labels": "0"})
        else:
            stage_results.check_layout(store, "duck", "here")
    assert str(caught.value).startswith("duck/front is damaged" if place else "the root of object duck is damaged")
    assert "glint verify duck --repair" in str(caught.value.remedy)


@pytest.mark.parametrize("place", ["front/", "front/labels/"])
@pytest.mark.parametrize("metadata", METADATA)
def test_what_is_computed_again_replaces_damaged_metadata(place: str, metadata: bytes) -> None:
    store = store_with(place, metadata)
    mask = np.zeros((2, 2), bool)
    write_stage(store, "duck", "front", "labels", "new key", arrays={"mask": mask}, record={})
    results = stage_results.read_capture(store, "duck", "front")
    assert {stage: result.key for stage, result in results.items()} == {"labels": "new key", "depth": "key"}
    assert not verify(results.values()).damages


def test_no_capture_or_file_takes_the_name_of_the_metadata() -> None:
    assert METADATA_FILE == ZARR_JSON and METADATA_FILE in RESERVED_IDS
    with pytest.raises(StoreError):
        check_name(METADATA_FILE, "capture")
    with pytest.raises(StoreError):
        check_file_name(METADATA_FILE, "duck/front")
