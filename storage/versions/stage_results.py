"""One stage's result as a group of a versioned store: its arrays, its key, its record and the blobs it names."""

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from datetime import date, datetime
from pathlib import PurePath
from typing import Any, cast

import numpy as np
import zarr
from zarr.codecs import BloscCodec
from zarr.errors import GroupNotFoundError

from glint.storage.blobs.store import BlobReference
from glint.storage.errors import StoreError

WHOLE_OBJECT = "_object"
"""Stands in a capture's place for results of the object as a whole, such as its model; no capture can be called so."""

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

CHUNK_BYTES = 4 << 20
"""Largest uncompressed chunk: bounds the memory of a save (zarr holds some ten chunks at once)."""

_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")


@dataclass(frozen=True, slots=True)
class StageResult:
    """What a stage left: `arrays` are read when indexed, or whole by `read`; all values of `record` are JSON."""

    capture: str
    stage: str
    key: str
    record: dict[str, Any]
    blobs: dict[str, BlobReference]
    arrays: dict[str, zarr.Array]

    def read(self, name: str) -> np.ndarray:
        """Array `name` in memory.

        Raises:
            StoreError: the stage has no such array.
        """
        if name not in self.arrays:
            raise StoreError(
                f"{self.capture}/{self.stage} has no array {name!r}, only {', '.join(sorted(self.arrays)) or 'none'}",
                "run the capture again with this version of Glint",
            )
        return np.asarray(self.arrays[name][...])


def check_name(name: str, what: str) -> str:
    """`name` if it is safe as a part of a store's path.

    Raises:
        StoreError: it is not.
    """
    if name != WHOLE_OBJECT and not _NAME.fullmatch(name):
        raise StoreError(f"{what} {name!r} cannot name a place in the store", "use [a-z0-9][a-z0-9._-]{0,63}")
    return name


def write_stage(
    store: Any,
    capture: str,
    stage: str,
    key: str,
    arrays: Mapping[str, Any],
    record: Mapping[str, Any],
    blobs: Mapping[str, BlobReference],
) -> None:
    """Replace the group `<capture>/<stage>` whole. Arrays, numpy's or zarr's, are copied chunk by chunk."""
    root = zarr.open_group(store, mode="a", use_consolidated=False)
    parent = root.require_group(check_name(capture, "capture"))
    if check_name(stage, "stage") in parent:
        del parent[stage]
    named = {name: asdict(reference) for name, reference in blobs.items()}
    group = parent.create_group(stage, attributes={"key": key, "record": jsonable(record), "blobs": named})
    for name, values in arrays.items():
        _write_array(group, check_name(name, "array"), values if isinstance(values, zarr.Array) else np.asarray(values))


def read_stage(store: Any, capture: str, stage: str) -> StageResult | None:
    """The stage's result without its arrays' values, or None where it was never saved."""
    group = open_group(store, f"{check_name(capture, 'capture')}/{check_name(stage, 'stage')}")
    if group is None:
        return None
    attributes: dict[str, Any] = dict(group.attrs)
    try:
        blobs = {name: BlobReference(**reference) for name, reference in attributes["blobs"].items()}
        return StageResult(capture, stage, attributes["key"], attributes["record"], blobs, dict(group.arrays()))
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


def named_blobs(store: Any) -> Iterator[str]:
    """Keys of the blobs that any stage of any capture names."""
    root = open_group(store, "")
    for _, capture in root.groups() if root is not None else ():
        for _, stage in capture.groups():
            for reference in cast("dict[str, dict[str, str]]", stage.attrs.get("blobs", {})).values():
                yield reference["key"]


def open_group(store: Any, path: str) -> zarr.Group | None:
    """The group at `path` for reading, or None."""
    try:
        return zarr.open_group(store, path=path, mode="r", use_consolidated=False)
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


def _write_array(group: zarr.Group, name: str, values: np.ndarray | zarr.Array) -> None:
    chunks = chunk_shape(values.shape, values.dtype.itemsize)
    array = group.create_array(
        name,
        shape=values.shape,
        chunks=chunks,
        dtype=values.dtype,
        fill_value=np.nan if values.dtype.kind == "f" else 0,
        compressors=BloscCodec(cname="zstd", clevel=3, shuffle="bitshuffle"),
    )
    if isinstance(values, np.ndarray):
        array[...] = values
        return
    rows = chunks[0] if values.ndim else 1
    for start in range(0, values.shape[0] if values.ndim else 1, rows):
        array[start : start + rows] = values[start : start + rows]
