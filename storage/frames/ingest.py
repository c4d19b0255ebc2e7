"""Write the cache of frames: decode in one thread, compress and store in another, continue after an interruption."""

import fcntl
import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import zarr

from glint.storage.catalogue.models import Region
from glint.storage.errors import InputError
from glint.storage.footage.source import Footage
from glint.storage.frames.layout import (
    LAYOUT_VERSION,
    chunks_of,
    create_arrays,
    metadata_digests,
    open_array,
    shard_frames,
)
from glint.storage.frames.shard_store import ShardStore
from glint.storage.fsync import flush
from glint.storage.locations.location import Location
from glint.storage.seals import is_sealed, sealed

Progress = Callable[[int, int | None], None]

_MAX_PENDING = 1
"""Shards that are being written while the next one is decoded; decoding pauses beyond."""


def check_crops(crops: Mapping[str, Region], footage: Footage) -> None:
    """Raise InputError if a crop leaves the frame."""
    for name, crop in crops.items():
        if crop.x + crop.width > footage.width or crop.y + crop.height > footage.height:
            raise InputError(
                f"the region of {name}, x {crop.x} to {crop.x + crop.width - 1} and y {crop.y} to"
                f" {crop.y + crop.height - 1}, leaves the frame of {footage.width} x {footage.height} pixels",
                "give a region inside the frame",
            )


@contextmanager
def writer_lock(location: Location, digest: str) -> Iterator[None]:
    """Wait until no other process of this machine writes this cache.

    In an object store two writers put the same bytes under the same keys, which is wasteful and harmless.
    """
    if location.local is None:
        yield
        return
    path = location.local / "frames" / f"{digest}.lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def open_group(folder: Location, footage: Footage, crops: Mapping[str, Region], source: Any) -> zarr.Group:
    """Open the group as an earlier writer left it, or create an empty one.

    source: what tells the footage's files from others (JSON); an incomplete cache of other files is begun anew.
    """
    shard = shard_frames(crops, footage.bits, footage.count)
    attributes: dict[str, Any] = {
        "name": folder.name,
        "layout": LAYOUT_VERSION,
        "bits": footage.bits,
        "shard_frames": shard,
        "frame_size": [footage.height, footage.width],
        "crops": {name: crop.model_dump() for name, crop in crops.items()},
    }
    store, chunks = folder.zarr_store(), chunks_of(crops)
    try:
        group = zarr.open_group(store, mode="r+", use_consolidated=False)
        stored: dict[str, Any] = dict(group.attrs)
        is_ours = is_sealed(stored) and all(stored.get(key) == value for key, value in attributes.items())
        is_current = is_ours and (stored["total"] is not None or stored["source"] == source)
        if is_current and stored["arrays"] == metadata_digests(group, crops):
            verified = ShardStore(store, chunks, stored["indices"])
            return zarr.open_group(verified, mode="r+", use_consolidated=False)
    except (FileNotFoundError, ValueError, TypeError, KeyError):
        pass
    group = zarr.open_group(ShardStore(store, chunks, {}), mode="w", use_consolidated=False)
    length = max(1, -(-footage.count // shard)) * shard
    create_arrays(group, length, footage.bits, crops, shard)
    attributes |= {"source": source, "arrays": metadata_digests(group, crops), "indices": {}}
    group.attrs.put(sealed({**attributes, "frames": 0, "total": None, "warnings": []}))
    return group


def write_frames(
    folder: Location,
    group: zarr.Group,
    footage: Footage,
    crops: Mapping[str, Region],
    start: int,
    progress: Progress | None,
) -> "ShardWriter":
    """Write all frames from the shard of frame `start` on; return the writer, which is to be finished."""
    size = int(cast(int, group.attrs["shard_frames"]))
    start -= start % size
    writer = ShardWriter(folder, group, tuple(crops), start, footage.count or None, progress)
    done = start
    # This thread decodes, the other one compresses and writes.
    with ThreadPoolExecutor(1) as executor:
        pending: deque[Future[None]] = deque()
        for shard in _shards(footage, crops, start, size):
            if len(pending) >= _MAX_PENDING:
                pending.popleft().result()
            pending.append(executor.submit(writer.write, shard))
            done += shard.length
        for future in pending:
            future.result()
    if done == 0:
        raise InputError(f"{footage.uri} holds no frame", "record or copy it again")
    return writer


@dataclass
class _Shard:
    """The frames of a shard from frame `start` on, the last shard's padded with zeros.

    crops: (shard's frames, height, width) by name; length: frames without padding.
    """

    start: int
    crops: dict[str, np.ndarray]
    length: int = 0


class ShardWriter:
    """Writes shards in order, each durably before the group's attributes count it."""

    def __init__(
        self,
        folder: Location,
        group: zarr.Group,
        names: tuple[str, ...],
        start: int,
        expected: int | None,
        progress: Progress | None,
    ) -> None:
        self._folder, self._group, self._expected, self._progress = folder, group, expected, progress
        self._arrays = {name: open_array(group, name) for name in names}
        self._written = start

    def write(self, shard: _Shard) -> None:
        """Write a shard and the number of frames so far."""
        if shard.start != self._written:
            return  # A shard before this one failed; counting this one would count the failed one too.
        for name, array in self._arrays.items():
            frames = shard.crops.pop(name)
            end = shard.start + len(frames)
            if array.shape[0] < end:
                array.resize((max(2 * array.shape[0], end), *array.shape[1:]))
            array[shard.start : end] = frames
            self._flush(name, shard.start // len(frames))
        self._written = shard.start + shard.length
        self._count(frames=self._written)
        if self._progress is not None:
            self._progress(self._written, self._expected)

    def finish(self, warnings: list[str]) -> None:
        """Cut the arrays to the number of frames, and mark the cache as complete."""
        total = self._written
        for array in self._arrays.values():
            array.resize((total, *array.shape[1:]))
        self._count(frames=total, total=total, warnings=warnings)

    def _count(self, **facts: Any) -> None:
        store = self._group.store
        assert isinstance(store, ShardStore)
        self._group.attrs.put(sealed({**self._group.attrs, **facts, "indices": store.indices}))

    def _flush(self, name: str, number: int) -> None:
        if self._folder.local is not None:
            flush(self._folder.local / name / "c" / str(number) / "0" / "0")


def _shards(footage: Footage, crops: Mapping[str, Region], start: int, size: int) -> Iterator[_Shard]:
    """Yield the crops of `size` frames at a time."""
    windows = {name: (crop.rows, crop.columns) for name, crop in crops.items()}
    dtype = np.dtype(f"uint{footage.bits}")
    shard: _Shard | None = None
    for number, frame in enumerate(footage.frames(start), start):
        if shard is None:
            # New arrays for each shard: the writer still reads those of the last.
            stacks = {name: np.zeros((size, crop.height, crop.width), dtype) for name, crop in crops.items()}
            shard = _Shard(number, stacks)
        for name, window in windows.items():
            shard.crops[name][shard.length] = frame[window]
        shard.length += 1
        if shard.length == size:
            yield shard
            shard = None
    if shard is not None:
        yield shard
