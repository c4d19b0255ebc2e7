"""Groups that hold stages whose metadata is damaged."""

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.core.common import ZARR_JSON
from zarr.storage import MemoryStore

from glint.storage.catalogue.models import RESERVED_IDS
from glint.storage.errors import DamagedError, StoreError
from glint.storage.locations.location import METADATA_FILE
from glint.storage.seals import SEAL, sealed
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stages import reader
from glint.storage.versions.stages.checksums import checksum
from glint.storage.versions.stages.names import check_file_name, check_name
from glint.storage.versions.stages.writer import write_stage
from glint.storage.versions.verification import verify, whole_result
from tests.storage.stores import local_store

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
                reader.saved_key(store, "duck", "front", "labels")
            reader.read_capture(store, "duck", "front", seals={"labels": "0"})
        else:
            reader.check_layout(store, "duck", "here")
    assert str(caught.value).startswith("duck/front is damaged" if place else "the root of object duck is damaged")
    assert "glint verify duck --repair" in str(caught.value.remedy)


@pytest.mark.parametrize("place", ["front/", "front/labels/"])
@pytest.mark.parametrize("metadata", METADATA)
def test_what_is_computed_again_replaces_damaged_metadata(place: str, metadata: bytes) -> None:
    store = store_with(place, metadata)
    mask = np.zeros((2, 2), bool)
    write_stage(store, "duck", "front", "labels", "new key", arrays={"mask": mask}, record={})
    results = reader.read_capture(store, "duck", "front")
    assert {stage: result.key for stage, result in results.items()} == {"labels": "new key", "depth": "key"}
    assert not verify(results.values()).damages


HOSTILE: list[tuple[dict[str, Any], str]] = [
    ({"files": None}, "no `files`"),
    ({"checksums": None}, "no `checksums`"),
    ({"key": None, "record": None, "name": None}, "no `name`, `key`, `record`"),
    ({"files": []}, "no `files`"),
    ({"files": {"a.ply": {"size": 1}}}, "no `files`"),
    ({"files": {"a.ply": {"size": "1", "sha256": "0", "media_type": "x"}}}, "no `files`"),
    ({"checksums": ["mask/zarr.json"]}, "no `checksums`"),
    ({"checksums": {"mask/zarr.json": 5}}, "no `checksums`"),
    ({"record": "text"}, "no `record`"),
    ({"key": 5}, "no `key`"),
]
"""Attributes of a stage in place of its own (None: left out), and what is said of them."""


@pytest.mark.parametrize(("changed", "says"), HOSTILE)
def test_attributes_that_somebody_else_has_sealed_are_refused(
    tmp_path: Path, changed: dict[str, Any], says: str
) -> None:
    repository = ObjectRepository.open(local_store(tmp_path), "duck")
    for stage in ("labels", "depth"):
        repository.save("front", stage, "key", {"mask": np.ones((2, 2), bool)}, {})
    session = repository.index.writable_session("work")
    group = zarr.open_group(session.store, path="front/labels", mode="a", use_consolidated=False)
    attributes = {name: value for name, value in (dict(group.attrs) | changed).items() if value is not None}
    hostile = sealed({name: value for name, value in attributes.items() if name != SEAL})
    group.attrs.put(hostile)
    session.commit("hostile")
    with pytest.raises(DamagedError, match=f"duck/front/labels is damaged.*{says}"):
        repository.load("front", "labels")
    with pytest.raises(DamagedError, match=f"duck/front/labels in v1 is damaged.*{says}"):
        reader.read_capture(session.store, "duck", "front", "v1", {"labels": hostile[SEAL]})
    assert repository.contents() == {"front": {"depth": "key"}}, "it counts as not saved, and is computed again"
    assert set(repository.records("front")) == set(repository.load_capture("front")) == {"depth"}
    assert repository.stage_key("front", "labels") is None
    assert whole_result(repository, "front", "labels", "key") is None
    repository.save("front", "labels", "key", {"mask": np.ones((2, 2), bool)}, {})
    assert repository.load("front", "labels").read("mask").all()


def test_metadata_that_somebody_else_has_sealed_are_refused() -> None:
    store, metadata = MemoryStore(), default_buffer_prototype().buffer.from_bytes(b"[]")
    write_stage(store, "duck", "front", "labels", "key", arrays={"mask": np.ones((2, 2), bool)}, record={})
    group = zarr.open_group(store, path="front/labels", mode="a", use_consolidated=False)
    attributes: dict[str, Any] = {name: value for name, value in group.attrs.items() if name != SEAL}
    known = dict(attributes["checksums"]) | {"mask/zarr.json": checksum(b"[]")}
    listed = {"a.ply": {"size": 1, "sha256": "0", "media_type": "model/ply"}}
    group.attrs.put(sealed(attributes | {"checksums": known, "files": listed}))
    asyncio.run(store.set("front/labels/mask/zarr.json", metadata))
    (labels,) = reader.read_capture(store, "duck", "front").values()
    with pytest.raises(DamagedError, match="duck/front/labels/mask is damaged"):
        labels.read("mask")
    with pytest.raises(DamagedError, match=r"file 'a\.ply' of duck/front/labels is damaged \(nothing was stored of it"):
        labels.read_file("a.ply")


def test_no_capture_or_file_takes_the_name_of_the_metadata() -> None:
    assert METADATA_FILE == ZARR_JSON and METADATA_FILE in RESERVED_IDS
    with pytest.raises(StoreError):
        check_name(METADATA_FILE, "capture")
    with pytest.raises(StoreError):
        check_file_name(METADATA_FILE, "duck/front")


@pytest.mark.parametrize("changed", [{"stages": None}, {"rolled_back": 5}, {"seals": {"front": "text"}}, {"time": "x"}])
def test_a_record_of_a_version_that_somebody_else_has_sealed_is_refused(
    tmp_path: Path, changed: dict[str, Any]
) -> None:
    repository = ObjectRepository.open(local_store(tmp_path), "duck")
    repository.save("front", "labels", "key", {"mask": np.ones((2, 2), bool)}, {})
    repository.publish(["front"], {})
    index = repository.index
    written = index.lookup_snapshot(index.lookup_tag("v1")).metadata
    record = {name: value for name, value in (written | changed | {"version": "v2"}).items() if value is not None}
    session = index.writable_session("main")
    zarr.open_group(session.store, mode="a", use_consolidated=False).attrs["more"] = 1
    snapshot = session.commit("v2", sealed({name: value for name, value in record.items() if name != SEAL}))
    index.create_tag("v2", snapshot)
    with pytest.raises(DamagedError, match=r"the record of v2 of duck is damaged \(it is not as Glint writes it"):
        repository.version("v2")
    assert repository.version("v1").stages == {"front": {"labels": "key"}}
