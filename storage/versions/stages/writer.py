"""Writing one stage's result into the group of a versioned store; see `stage_results` for its layout."""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import default_buffer_prototype
from zarr.core.group import GroupMetadata
from zarr.core.sync import sync

from glint.storage.errors import DamagedError, StoreError
from glint.storage.json_values import json_value
from glint.storage.locations.location import METADATA_FILE
from glint.storage.seals import sealed
from glint.storage.versions.stage_results import FileInfo, StoredFile
from glint.storage.versions.stages.checksums import FILES_GROUP, RecordingStore
from glint.storage.versions.stages.groups import LAYOUT_NUMBER, readable_metadata
from glint.storage.versions.stages.names import check_file_name, check_name

MAX_CHUNK_BYTES = 4 << 20
"""Size of the largest uncompressed chunk: bounds the memory of a save, as zarr holds about ten chunks at once."""


def write_stage(
    store: Any,
    object_id: str,
    capture: str,
    stage: str,
    key: str,
    *,
    arrays: Mapping[str, Any],
    record: Mapping[str, Any],
    files: Mapping[str, StoredFile] | None = None,
) -> None:
    """Replace the group `<capture>/<stage>` as a whole. Arrays, of numpy or zarr, are copied chunk by chunk.

    The group's attributes are written last: key, record, and the checksums of all else in the group, sealed.

    Raises:
        StoreError: a name cannot be part of a path in the store.
    """
    recording, path = RecordingStore(store), f"{check_name(capture, 'capture')}/{check_name(stage, 'stage')}"
    attributes = sealed({"layout": LAYOUT_NUMBER, "object": object_id})
    root = zarr.open_group(recording, mode="a", use_consolidated=False, attributes=attributes)
    parent = _capture_group(root, object_id, capture)
    # Not read before it is removed: it may be damaged.
    sync(recording.delete_dir(path))
    group = parent.create_group(stage)
    for name, values in arrays.items():
        if name == FILES_GROUP:
            raise StoreError(f"{capture}/{stage} has an array named {name!r}", "give the array another name")
        _write_array(group, check_name(name, "array"), values if isinstance(values, zarr.Array) else np.asarray(values))
    infos = {}
    folder = group.create_group(FILES_GROUP) if files else group
    for name, file in (files or {}).items():
        infos[name] = asdict(FileInfo(len(file.data), hashlib.sha256(file.data).hexdigest(), file.media_type))
        content = np.frombuffer(file.data, np.uint8)
        _write_array(folder, check_file_name(name, f"{capture}/{stage}"), content, infos[name])
    written = {
        place.removeprefix(f"{path}/"): value
        for place, value in recording.checksums.items()
        if place.startswith(f"{path}/") and place != f"{path}/{METADATA_FILE}"
    }
    own = {"name": f"{object_id}/{path}", "key": key, "record": json_value(record), "files": infos}
    group.attrs.put(sealed(own | {"checksums": written}))


def _capture_group(root: zarr.Group, object_id: str, capture: str) -> zarr.Group:
    """Return a capture's group, made where there is none; metadata of it that cannot be read are replaced."""
    try:
        with readable_metadata(object_id, capture):
            return root.require_group(capture)
    except DamagedError:
        # What the group holds, edits among it, stays.
        for name, value in GroupMetadata().to_buffer_dict(default_buffer_prototype()).items():
            sync(root.store.set(f"{capture}/{name}", value))
        return root.require_group(capture)


def chunk_shape(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Return the shape of chunks of at most MAX_CHUNK_BYTES; the longest axis is halved until they fit."""
    chunks = [max(1, edge) for edge in shape]
    while math.prod(chunks) * itemsize > MAX_CHUNK_BYTES:
        longest = chunks.index(max(chunks))
        chunks[longest] = -(-chunks[longest] // 2)
    return tuple(chunks)


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
    # Copy a stored array by rows of chunks, so that it is never in memory as a whole.
    rows = chunks[0] if values.ndim else 1
    for start in range(0, values.shape[0] if values.ndim else 1, rows):
        array[start : start + rows] = values[start : start + rows]
