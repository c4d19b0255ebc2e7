"""One stage's result as a group of a versioned store: key and record as its attributes, its arrays, its files.

Files (meshes, pictures) are uint8 arrays (size,) in the subgroup `files`, named like the file. They are part of the
commit: a version holds whole results. Chunks carry a checksum (CRC-32C), files their SHA-256 as well.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, cast

import icechunk
import numpy as np
import zarr
from zarr.errors import GroupNotFoundError

from glint.storage.errors import StoreError, StoreUnreachable
from glint.storage.locations.error_translation import translate

WHOLE_OBJECT = "_object"
"""Takes the place of a capture for results of the whole object, such as its model; no capture can have this name."""

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

LAYOUT_NUMBER = 2
"""Number of this layout, stored in the root group's attribute `layout`; the first layout had no number."""

FILES_GROUP = "files"
"""Name of the subgroup of a stage's files; no array can have this name."""

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_DAMAGE_REMEDY = "restore the store from a backup, or use a new --store and run again"


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

    file_arrays: arrays that hold the content of `files`, for `read_file` alone.
    """

    object_id: str
    capture: str
    stage: str
    key: str
    record: dict[str, Any]
    files: dict[str, FileInfo]
    arrays: dict[str, zarr.Array]
    file_arrays: dict[str, zarr.Array] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """Object, capture and stage, for messages."""
        return f"{self.object_id}/{self.capture}/{self.stage}"

    def read(self, name: str) -> np.ndarray:
        """Return array `name`, read into memory.

        Raises:
            StoreError: the stage has no such array, or its chunks are damaged.
        """
        if name not in self.arrays:
            raise _absent_error(self.name, "array", name, self.arrays)
        with _damage_reported(f"array {name!r} of {self.name}"):
            return np.asarray(self.arrays[name][...])

    def read_file(self, name: str) -> bytes:
        """Return the content of file `name`, verified by its size and SHA-256.

        Raises:
            StoreError: the stage has no such file, or its content is damaged.
        """
        if name not in self.files:
            raise _absent_error(self.name, "file", name, self.files)
        info, label = self.files[name], f"file {name!r} of {self.name}"
        with _damage_reported(label):
            data = np.asarray(self.file_arrays[name][...]).tobytes()
        if len(data) != info.size or hashlib.sha256(data).hexdigest() != info.sha256:
            raise StoreError(f"{label} does not hold the bytes that were stored", _DAMAGE_REMEDY)
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
    if not is_name(name):
        raise StoreError(f"{kind} {name!r} cannot be a name in the store", "use [a-z0-9][a-z0-9._-]{0,63}")
    return name


def check_file_name(name: str, owner: str) -> str:
    """Return `name` if it is a plain file name, without folders.

    Raises:
        StoreError: it is not.
    """
    if not _FILE_NAME.fullmatch(name) or name == "zarr.json":
        raise StoreError(f"{owner} names a file {name!r}, which could leave its folder", "do not trust this store")
    return name


def check_layout(store: Any, object_id: str, uri: str) -> None:
    """Check that a store is empty or has the layout of this version of Glint.

    Raises:
        StoreError: another version of Glint has written it.
    """
    root = open_group(store, "")
    layout = LAYOUT_NUMBER if root is None else root.attrs.get("layout", 1)
    if layout != LAYOUT_NUMBER:
        older = not isinstance(layout, int) or layout < LAYOUT_NUMBER
        raise StoreError(
            f"object {object_id} in {uri} was written by {'an older' if older else 'a newer'} version of Glint "
            f"(layout {layout}; this version reads layout {LAYOUT_NUMBER})",
            "use a new --store and run again" if older else "update Glint, or use a new --store and run again",
        )


def read_stage(store: Any, object_id: str, capture: str, stage: str) -> StageResult | None:
    """Return the stage's result without the values of arrays and files, or None where it was never saved.

    Raises:
        StoreError: the group is not a stage's result.
    """
    group = open_group(store, f"{check_name(capture, 'capture')}/{check_name(stage, 'stage')}")
    if group is None:
        return None
    attributes: dict[str, Any] = dict(group.attrs)
    members = dict(group.members())
    folder = members.get(FILES_GROUP)
    arrays = {name: member for name, member in members.items() if isinstance(member, zarr.Array)}
    file_arrays = dict(folder.arrays()) if isinstance(folder, zarr.Group) else {}
    try:
        files = {name: FileInfo(**cast("dict[str, Any]", dict(array.attrs))) for name, array in file_arrays.items()}
        key, record = attributes["key"], attributes["record"]
        return StageResult(object_id, capture, stage, key, record, files, arrays, file_arrays)
    except (KeyError, TypeError) as error:
        raise StoreError(f"{object_id}/{capture}/{stage} is not a result ({error})", "run it again") from error


def read_capture(store: Any, object_id: str, capture: str) -> dict[str, StageResult]:
    """Return all results of a capture by stage."""
    results = {stage: read_stage(store, object_id, capture, stage) for stage in stage_keys(store, capture)}
    return {stage: result for stage, result in results.items() if result is not None}


def contents(store: Any) -> Keys:
    """Return the stage keys of everything in a store, WHOLE_OBJECT included."""
    root = open_group(store, "")
    return {} if root is None else {name: stage_keys(store, name) for name in sorted(root.group_keys())}


def stage_keys(store: Any, capture: str) -> dict[str, str]:
    """Return the keys of the saved stages of a capture."""
    return {stage: key for stage, (key, _) in stage_records(store, capture).items()}


def stage_records(store: Any, capture: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return key and record of the saved stages of a capture."""
    group = open_group(store, check_name(capture, "capture"))
    stages = {} if group is None else dict(group.groups())
    return {
        name: (str(stage.attrs["key"]), cast("dict[str, Any]", stage.attrs["record"]))
        for name, stage in sorted(stages.items())
        if "key" in stage.attrs and "record" in stage.attrs
    }


def open_group(store: Any, path: str) -> zarr.Group | None:
    """Open the group at `path` for reading; None if there is none."""
    try:
        return zarr.open_group(store, path=path, mode="r", use_consolidated=False, zarr_format=3)
    except GroupNotFoundError:
        return None


def _absent_error(owner: str, kind: str, name: str, present: Mapping[str, Any]) -> StoreError:
    return StoreError(
        f"{owner} has no {kind} {name!r}, only {', '.join(sorted(present)) or 'none'}",
        "run the capture again with this version of Glint",
    )


@contextmanager
def _damage_reported(label: str) -> Iterator[None]:
    """Raise a StoreError where chunks are missing, truncated or do not match their checksum.

    Raises:
        StoreUnreachable: the store does not answer.
    """
    try:
        yield
    except (ValueError, RuntimeError, icechunk.IcechunkError) as error:
        translated = translate("the store", f"reading {label}", error)
        if isinstance(translated, StoreUnreachable):
            raise translated from error
        raise StoreError(f"{label} is damaged ({' '.join(str(error).split())[:200]})", _DAMAGE_REMEDY) from error
