"""One stage's result as a group of a versioned store: key and record as its attributes, its arrays, its files.

Files (meshes, pictures) are uint8 arrays (size,) in the subgroup `files`, named like the file. They are part of the
commit: a version holds whole results. Chunks carry a checksum (CRC-32C), files their SHA-256 as well.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, is_dataclass
from datetime import date, datetime
from pathlib import PurePath
from typing import Any, cast

import icechunk
import numpy as np
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.errors import GroupNotFoundError

from glint.storage.errors import StoreError

WHOLE_OBJECT = "_object"
"""Stands in a capture's place for results of the object as a whole, such as its model; no capture can be called so."""

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

CHUNK_BYTES = 4 << 20
"""Largest uncompressed chunk: bounds the memory of a save (zarr holds some ten chunks at once)."""

LAYOUT_NUMBER = 2
"""Number of this arrangement of groups, in the root group's attribute `layout`. The first layout had no number."""

FILES = "files"
"""Name of the subgroup of a stage's files; no array can have this name."""

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_DAMAGED = "restore the store from a backup, or use a new --store and run again"


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
    """A stored result. `arrays` are read when indexed, or whole by `read`; files by `read_file`; `record` is JSON."""

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
            raise _missing(self.name, "array", name, self.arrays)
        with _damage_refused(f"array {name!r} of {self.name}"):
            return np.asarray(self.arrays[name][...])

    def read_file(self, name: str) -> bytes:
        """Return the content of file `name`, verified by its size and SHA-256.

        Raises:
            StoreError: the stage has no such file, or its content is damaged.
        """
        if name not in self.files:
            raise _missing(self.name, "file", name, self.files)
        info, label = self.files[name], f"file {name!r} of {self.name}"
        with _damage_refused(label):
            data = np.asarray(self.file_arrays[name][...]).tobytes()
        if len(data) != info.size or hashlib.sha256(data).hexdigest() != info.sha256:
            raise StoreError(f"{label} does not hold the bytes that were stored", _DAMAGED)
        return data


def check_name(name: str, what: str) -> str:
    """`name` if it is safe as a part of a store's path.

    Raises:
        StoreError: it is not.
    """
    if name != WHOLE_OBJECT and not _NAME.fullmatch(name):
        raise StoreError(f"{what} {name!r} cannot name a place in the store", "use [a-z0-9][a-z0-9._-]{0,63}")
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
    """Check that a store has the layout of this version of Glint, or nothing yet.

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


def write_stage(
    store: Any,
    capture: str,
    stage: str,
    key: str,
    arrays: Mapping[str, Any],
    record: Mapping[str, Any],
    files: Mapping[str, StoredFile],
) -> None:
    """Replace the group `<capture>/<stage>` whole. Arrays, numpy's or zarr's, are copied chunk by chunk."""
    root = zarr.open_group(store, mode="a", use_consolidated=False, attributes={"layout": LAYOUT_NUMBER})
    parent = root.require_group(check_name(capture, "capture"))
    if check_name(stage, "stage") in parent:
        del parent[stage]
    group = parent.create_group(stage, attributes={"key": key, "record": jsonable(record)})
    for name, values in arrays.items():
        if name == FILES:
            raise StoreError(f"{capture}/{stage} has an array named {FILES!r}", "give the array another name")
        _write_array(group, check_name(name, "array"), values if isinstance(values, zarr.Array) else np.asarray(values))
    if files:
        folder = group.create_group(FILES)
        for name, file in files.items():
            info = FileInfo(len(file.data), hashlib.sha256(file.data).hexdigest(), file.media_type)
            content = np.frombuffer(file.data, np.uint8)
            _write_array(folder, check_file_name(name, f"{capture}/{stage}"), content, asdict(info))


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
    folder = members.get(FILES)
    arrays = {name: member for name, member in members.items() if isinstance(member, zarr.Array)}
    file_arrays = dict(folder.arrays()) if isinstance(folder, zarr.Group) else {}
    try:
        files = {name: FileInfo(**cast("dict[str, Any]", dict(of.attrs))) for name, of in file_arrays.items()}
        key, record = attributes["key"], attributes["record"]
        return StageResult(object_id, capture, stage, key, record, files, arrays, file_arrays)
    except (KeyError, TypeError) as error:
        raise StoreError(f"{capture}/{stage} holds something else than a result ({error})", "run it again") from error


def contents(store: Any) -> Keys:
    """Stage keys of everything in a store, WHOLE_OBJECT included."""
    root = open_group(store, "")
    return {} if root is None else {name: stage_keys(store, name) for name in sorted(root.group_keys())}


def stage_keys(store: Any, capture: str) -> dict[str, str]:
    """Key of each stage of a capture that has been saved."""
    return {stage: key for stage, (key, _) in stage_records(store, capture).items()}


def stage_records(store: Any, capture: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """Key and record of each stage of a capture that has been saved."""
    group = open_group(store, check_name(capture, "capture"))
    stages = {} if group is None else dict(group.groups())
    return {
        name: (str(stage.attrs["key"]), cast("dict[str, Any]", stage.attrs["record"]))
        for name, stage in sorted(stages.items())
        if "key" in stage.attrs and "record" in stage.attrs
    }


def open_group(store: Any, path: str) -> zarr.Group | None:
    """The group at `path` for reading, or None."""
    try:
        return zarr.open_group(store, path=path, mode="r", use_consolidated=False, zarr_format=3)
    except GroupNotFoundError:
        return None


def jsonable(value: Any) -> Any:
    """`value` as plain JSON; numbers that are not finite become null.

    Raises:
        TypeError: a part of it has no JSON form.
    """
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(name): jsonable(part) for name, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [jsonable(part) for part in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, datetime | date):
        return value.isoformat()
    if isinstance(value, PurePath):
        return str(value)
    return json.loads(json.dumps(value))


def chunk_shape(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Chunks of at most CHUNK_BYTES: whole trailing axes as long as possible, the longest axis halved first."""
    chunks = [max(1, edge) for edge in shape]
    while math.prod(chunks) * itemsize > CHUNK_BYTES:
        longest = chunks.index(max(chunks))
        chunks[longest] = -(-chunks[longest] // 2)
    return tuple(chunks)


def _missing(owner: str, kind: str, name: str, present: Mapping[str, Any]) -> StoreError:
    return StoreError(
        f"{owner} has no {kind} {name!r}, only {', '.join(sorted(present)) or 'none'}",
        "run the capture again with this version of Glint",
    )


@contextmanager
def _damage_refused(label: str) -> Iterator[None]:
    """Raise a StoreError where chunks are missing, truncated or do not match their checksum."""
    try:
        yield
    except (ValueError, RuntimeError, icechunk.IcechunkError) as error:
        raise StoreError(f"{label} is damaged ({' '.join(str(error).split())[:200]})", _DAMAGED) from error


def _write_array(
    group: zarr.Group, name: str, values: np.ndarray | zarr.Array, attributes: Mapping[str, Any] | None = None
) -> None:
    chunks = chunk_shape(values.shape, values.dtype.itemsize)
    array = group.create_array(
        name,
        shape=values.shape,
        chunks=chunks,
        dtype=values.dtype,
        fill_value=np.nan if values.dtype.kind == "f" else 0,
        compressors=(BloscCodec(cname="zstd", clevel=3, shuffle="bitshuffle"), Crc32cCodec()),
        attributes=dict(attributes or {}),
    )
    if isinstance(values, np.ndarray):
        array[...] = values
        return
    rows = chunks[0] if values.ndim else 1
    for start in range(0, values.shape[0] if values.ndim else 1, rows):
        array[start : start + rows] = values[start : start + rows]
