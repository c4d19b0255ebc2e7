"""One stage's result as a group of a versioned store: key and record as its attributes, its arrays, its files.

Files (meshes, pictures) are uint8 arrays (size,) in the subgroup `files`, named like the file. They are part of the
commit: a version holds whole results. All that is read is verified, see `checksums`.
"""

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zarr

from glint.storage.errors import StoreError, damaged
from glint.storage.locations.location import METADATA_FILE
from glint.storage.seals import SEAL, is_sealed
from glint.storage.versions.checksums import VerifiedArrays, VerifiedStore
from glint.storage.versions.groups import open_group, readable_metadata

WHOLE_OBJECT = "_object"
"""Takes the place of a capture for results of the whole object, such as its model; no capture can have this name."""

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

EarlierKeys = dict[str, list[dict[str, str]]]
"""By capture the stage keys of several results."""

LAYOUT_NUMBER = 3
"""Number of this layout, stored in the root group's attribute `layout`; the first layout had no number."""

FILES_GROUP = "files"
"""Name of the subgroup of a stage's files; no array can have this name."""

_METADATA_END = f"/{METADATA_FILE}"
_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")


@dataclass(frozen=True, slots=True)
class StoredFile:
    """Content and media type of a file to be stored."""

    data: bytes
    media_type: str


@dataclass(frozen=True, slots=True)
class FileInfo:
    """Size in bytes, SHA-256 (hexadecimal) and media type of a stored file."""

    size: int
    sha256: str
    media_type: str


@dataclass(frozen=True, slots=True)
class StageResult:
    """A stored result: `arrays` are read when indexed, or whole by `read`, files by `read_file`; `record` is JSON.

    version: its name, `work` for the newest results. seal: the checksum of all of it. checksums: of its values by key.
    file_arrays: arrays that hold the content of `files`, for `read_file` alone.
    """

    object_id: str
    capture: str
    stage: str
    key: str
    record: dict[str, Any]
    files: dict[str, FileInfo]
    arrays: Mapping[str, zarr.Array]
    file_arrays: Mapping[str, zarr.Array] = field(default_factory=dict, repr=False)
    version: str = "work"
    seal: str = ""
    checksums: dict[str, str] = field(default_factory=dict, repr=False)
    store: Any = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Object, capture, stage and version, for messages."""
        return owner_name(self.object_id, self.capture, self.stage, self.version)

    def read(self, name: str) -> np.ndarray:
        """Return array `name`, read into memory.

        Raises:
            StoreError: the stage has no such array; DamagedError: it is damaged.
        """
        if name not in self.arrays:
            raise _absent_error(self.name, "array", name, self.arrays)
        return np.asarray(self.arrays[name][...])

    def read_file(self, name: str) -> bytes:
        """Return the content of file `name`, verified by its size and SHA-256.

        Raises:
            StoreError: the stage has no such file; DamagedError: it is damaged.
        """
        if name not in self.files:
            raise _absent_error(self.name, "file", name, self.files)
        info, data = self.files[name], np.asarray(self.file_arrays[name][...]).tobytes()
        if len(data) != info.size or hashlib.sha256(data).hexdigest() != info.sha256:
            raise damaged(f"file {name!r} of {self.name}", "it is not what was written", self.object_id)
        return data


def is_name(name: str) -> bool:
    """Return whether `name` can be a part of a path in a store."""
    return name == WHOLE_OBJECT or _NAME.fullmatch(name) is not None


def check_name(name: str, kind: str) -> str:
    """Return `name` if it can be a part of a path in a store.

    kind: of the named thing, for the message.

    Raises:
        StoreError: it cannot.
    """
    # Objects have folders of their own, all else lies in a group beside the group's metadata.
    if not is_name(name) or (kind != "object" and name == METADATA_FILE):
        raise StoreError(f"{kind} {name!r} cannot be a name in the store", f"use {_NAME.pattern}, not {METADATA_FILE}")
    return name


def check_file_name(name: str, owner: str) -> str:
    """Return `name` if it is a plain file name, without folders.

    Raises:
        StoreError: it is not.
    """
    if not _FILE_NAME.fullmatch(name) or name == METADATA_FILE:
        raise StoreError(f"{owner} names a file {name!r}, which could leave its folder", "do not trust this store")
    return name


def check_layout(store: Any, object_id: str, uri: str) -> None:
    """Check that a store is empty or has the layout of this version of Glint.

    Raises:
        StoreError: another version of Glint has written it; DamagedError: what says so is damaged.
    """
    root = open_group(store, object_id, "")
    if root is None:
        return
    layout = root.attrs.get("layout", 1)
    if SEAL in root.attrs and not is_sealed(dict(root.attrs)):
        raise damaged(f"the root of object {object_id} in {uri}", "its attributes are not what was written", object_id)
    if layout != LAYOUT_NUMBER:
        older = not isinstance(layout, int) or layout < LAYOUT_NUMBER
        raise StoreError(
            f"object {object_id} in {uri} was written by {'an older' if older else 'a newer'} version of Glint "
            f"(layout {layout}; this version reads layout {LAYOUT_NUMBER})",
            "use a new --store and run again" if older else "update Glint, or use a new --store and run again",
        )


def read_stage(store: Any, object_id: str, capture: str, stage: str) -> StageResult | None:
    """Return the stage's newest result without the values of arrays and files, or None where it was never saved.

    Raises:
        DamagedError: the group is not what was written as this stage's result.
    """
    group = open_group(store, object_id, f"{check_name(capture, 'capture')}/{check_name(stage, 'stage')}")
    return None if group is None else _result(store, dict(group.attrs), object_id, capture, stage, "work")


def read_capture(
    store: Any, object_id: str, capture: str, version: str = "work", seals: Mapping[str, str] | None = None
) -> dict[str, StageResult]:
    """Return the results of a capture by stage; seals: of the stages that it must have, by default it has any.

    Raises:
        DamagedError: one is damaged, missing or another.
    """
    attributes, results = stage_attributes(store, object_id, capture), dict[str, StageResult]()
    for stage in attributes if seals is None else seals:
        owner = owner_name(object_id, capture, stage, version)
        if stage not in attributes:
            raise damaged(owner, "it is missing, or its attributes are not what was written", object_id)
        if seals is not None and attributes[stage][SEAL] != seals[stage]:
            raise damaged(owner, "it is not the result of this version", object_id)
        results[stage] = _result(store, attributes[stage], object_id, capture, stage, version)
    return results


def _result(
    store: Any, attributes: dict[str, Any], object_id: str, capture: str, stage: str, version: str
) -> StageResult:
    owner, path = owner_name(object_id, capture, stage, version), f"{capture}/{stage}"
    if not is_sealed(attributes) or attributes["name"] != f"{object_id}/{path}":
        raise damaged(owner, "its attributes are not what was written", object_id)
    checksums: dict[str, str] = attributes["checksums"]
    verified = VerifiedStore(store, path, checksums, owner, object_id)
    places = [key.removesuffix(_METADATA_END) for key in checksums if key.endswith(_METADATA_END)]
    files = {name: FileInfo(**info) for name, info in attributes["files"].items()}
    arrays = VerifiedArrays(verified, path, [place for place in places if "/" not in place and place != FILES_GROUP])
    return StageResult(
        object_id, capture, stage, attributes["key"], attributes["record"], files, arrays,
        VerifiedArrays(verified, f"{path}/{FILES_GROUP}", files), version, attributes[SEAL], checksums, verified,
    )  # fmt: skip


def contents(store: Any, object_id: str) -> Keys:
    """Return the stage keys of everything in a store, WHOLE_OBJECT included."""
    root = open_group(store, object_id, "")
    with readable_metadata(object_id, ""):
        names = [] if root is None else sorted(root.group_keys())
    return {name: stage_keys(store, object_id, name) for name in names}


def saved_key(store: Any, object_id: str, capture: str, stage: str) -> str | None:
    """Return the key of one saved stage; None where it was never saved, or its attributes are damaged.

    Raises:
        DamagedError: metadata of the capture or the stage cannot be read.
    """
    # A stage is computed again if its capture's metadata are damaged, which replaces them.
    is_known = open_group(store, object_id, check_name(capture, "capture")) is not None
    group = open_group(store, object_id, f"{capture}/{check_name(stage, 'stage')}") if is_known else None
    attributes: dict[str, Any] = {} if group is None else dict(group.attrs)
    return attributes.get("key") if is_sealed(attributes) else None


def stage_keys(store: Any, object_id: str, capture: str) -> dict[str, str]:
    """Return the keys of the saved stages of a capture."""
    return {stage: attributes["key"] for stage, attributes in stage_attributes(store, object_id, capture).items()}


def stage_attributes(store: Any, object_id: str, capture: str) -> dict[str, dict[str, Any]]:
    """Return the attributes of the saved stages of a capture; one whose attributes are damaged counts as not saved."""
    group = open_group(store, object_id, check_name(capture, "capture"))
    with readable_metadata(object_id, capture):
        stages = {} if group is None else dict(group.groups())
        attributes = {name: dict(stage.attrs) for name, stage in sorted(stages.items())}
    return {name: values for name, values in attributes.items() if is_sealed(values) and "key" in values}


def _absent_error(owner: str, kind: str, name: str, present: Mapping[str, Any]) -> StoreError:
    return StoreError(
        f"{owner} has no {kind} {name!r}, only {', '.join(sorted(present)) or 'none'}",
        "run the capture again with this version of Glint",
    )


def owner_name(object_id: str, capture: str, stage: str, version: str) -> str:
    """Return object, capture, stage and version, as messages name a result."""
    return f"{object_id}/{capture}/{stage}" + (f" in {version}" if version != "work" else "")
