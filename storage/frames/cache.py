"""Frames of a capture, cropped and cut into chunks that are cheap to read over time: STORE/frames/<digest>/.

A zarr group with one array (T, height, width) per crop: `object`, `sphere-0`, .., and a few whole frames, made smaller
where they are large: `overview`. It is a cache: it can be rebuilt, and a cache that was interrupted goes on at its last
whole shard. Each shard holds 64 frames, is written whole and once, and is on the disk before the group's attributes
count it.
"""

import fcntl
import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Literal, cast

import cv2
import numpy as np
import zarr
from zarr.codecs import BloscCodec

from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError, StoreError
from glint.storage.footage.source import Footage
from glint.storage.fsync import flush
from glint.storage.inputs.digests import digest_of
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

SHARD = 64
"""Frames of a shard, and edge of a chunk in pixels and frames."""
_WHOLE: Any = {"write_empty_chunks": True, "read_missing_chunks": False}
"""Black frames are stored like others, so that what is missing is never read as black."""
OVERVIEW = "overview"
_OVERVIEWS, _OVERVIEW_PIXELS = 12, 1 << 19
"""About how many whole frames are kept, and pixels beyond which they are made smaller."""
_LAYOUT = 2
COMPRESSOR: Literal["lz4", "zstd"] = "lz4"
"""Of blosc: reads several times as fast as zstd for a few per cent more bytes, frames being mostly noise."""
_WAITING = 2
_ALL = slice(None)
_REBUILD = "delete this cache, or run again with --rehash; it is rebuilt from the footage"


def cache_digest(footage: str, crops: Mapping[str, Region]) -> str:
    """Name of the cache of these crops of the footage with this content digest."""
    return digest_of(
        {"footage": footage, "layout": _LAYOUT, "crops": {name: c.model_dump() for name, c in crops.items()}}
    )


class FrameCache:
    """Frames that were ingested.

    frames: how many there are so far; total: how many in all, None until known; bits: 8 or 16; crops: by array, in
    pixels of the full frame; frame_size: (height, width) of that; reduction: how many times smaller the overview is;
    warnings: what was wrong with the footage.
    """

    def __init__(self, location: Location, digest: str, group: zarr.Group) -> None:
        self.location, self.digest, self._group = location, digest, group
        self._arrays: dict[str, Any] = {}
        attributes = dict(group.attrs)
        try:
            if attributes["layout"] != _LAYOUT:
                raise StoreError(f"the frames at {location.uri} have layout {attributes['layout']}", _REBUILD)
            self.frames = int(cast(int, attributes["frames"]))
            self.total = cast("int | None", attributes["total"])
            self.bits = int(cast(int, attributes["bits"]))
            height, width = cast("list[int]", attributes["frame_size"])
            self.frame_size = (int(height), int(width))
            crops = cast("dict[str, dict[str, int]]", attributes["crops"])
            self.crops = {name: Region(**crop) for name, crop in crops.items()}
            every, self.reduction = cast("list[int]", attributes["overview"])
            self._overviews = -(-self.frames // int(every))
            self.warnings = tuple(str(text) for text in cast("list[str]", attributes["warnings"]))
        except (KeyError, TypeError, ValueError) as error:
            raise StoreError(f"the frames at {location.uri} have damaged attributes", _REBUILD) from error

    @property
    def complete(self) -> bool:
        """Whether all frames of the footage are there."""
        return self.total is not None and self.frames == self.total

    @classmethod
    def open(cls, location: Location, digest: str) -> "FrameCache":
        """The cache as it is, complete or not.

        Raises:
            StoreError: there is none, or it is damaged.
        """
        place = location.child("frames", digest)
        with store_errors(place.uri, "opening frames"):
            try:
                return cls(
                    place, digest, zarr.open_group(place.zarr_store(read_only=True), mode="r", use_consolidated=False)
                )
            except (FileNotFoundError, ValueError, TypeError) as error:
                raise StoreError(f"there are no frames at {place.uri}", "run the capture's frames first") from error

    @classmethod
    def ingest(
        cls,
        footage: Footage,
        location: Location,
        digest: str,
        crops: Mapping[str, Region],
        progress: Callable[[int, int | None], None] | None = None,
    ) -> "FrameCache":
        """Make the cache complete; nothing is read from the footage if it is already.

        progress: told (frames done, frames expected or None) after each shard.

        Raises:
            InputError: the footage cannot be read or has no frame, or a crop leaves the frame.
            StoreError: the store cannot be written.
        """
        _check(crops, footage)
        place = location.child("frames", digest)
        with store_errors(place.uri, "writing frames"), _only_writer(location, digest):
            group = _begin(place, footage, crops)
            cache = cls(place, digest, group)
            if not cache.complete:
                _write_all(place, group, footage, crops, cache.frames, progress)
        return cls.open(location, digest)

    def overview(self) -> np.ndarray:
        """Some whole frames (N, h, w) over the capture, the first one first, `reduction` times smaller.

        Raises:
            StoreError: they cannot be read.
        """
        return self._read(OVERVIEW, (slice(self._overviews),))

    def read(self, name: str, frames: slice = _ALL, rows: slice = _ALL, columns: slice = _ALL) -> np.ndarray:
        """(T, h, w) of a crop, uint8 or uint16; whole chunks (multiples of 64) are the cheapest.

        Raises:
            StoreError: no such crop, or it cannot be read.
        """
        if name not in self.crops:
            raise StoreError(f"{self.location.uri} has no frames of {name!r}", f"there are {', '.join(self.crops)}")
        start, stop, step = frames.indices(self.frames)
        return self._read(name, (slice(start, stop, step), rows, columns))

    def _read(self, name: str, where: tuple[slice, ...]) -> np.ndarray:
        with store_errors(self.location.uri, f"reading frames of {name}"):
            try:
                if name not in self._arrays:
                    self._arrays[name] = _array(self._group, name)
                return np.asarray(self._arrays[name][where])
            except (KeyError, ValueError, RuntimeError) as error:
                raise StoreError(f"the frames of {name} at {self.location.uri} are damaged", _REBUILD) from error


def _check(crops: Mapping[str, Region], footage: Footage) -> None:
    for name, crop in crops.items():
        if crop.x < 0 or crop.y < 0 or crop.x + crop.width > footage.width or crop.y + crop.height > footage.height:
            raise InputError(
                f"the region of {name}, x {crop.x} to {crop.x + crop.width - 1} and y {crop.y} to"
                f" {crop.y + crop.height - 1}, leaves the frame of {footage.width} x {footage.height} pixels",
                "give a region inside the frame",
            )


def _begin(place: Location, footage: Footage, crops: Mapping[str, Region]) -> zarr.Group:
    """The group as an earlier writer left it, or an empty one."""
    wanted: dict[str, Any] = {
        "layout": _LAYOUT,
        "bits": footage.bits,
        "frame_size": [footage.height, footage.width],
        "crops": {name: crop.model_dump() for name, crop in crops.items()},
        "overview": [
            max(SHARD // 4, footage.count // _OVERVIEWS) if footage.count else SHARD,
            max(1, round((footage.height * footage.width / _OVERVIEW_PIXELS) ** 0.5)),
        ],
    }
    store = place.zarr_store()
    try:
        group = zarr.open_group(store, mode="r+", use_consolidated=False)
        if all(group.attrs.get(key) == value for key, value in wanted.items()):
            return group
    except (FileNotFoundError, ValueError, TypeError, KeyError):
        pass
    group = zarr.open_group(store, mode="w", use_consolidated=False)
    length = max(1, -(-footage.count // SHARD)) * SHARD
    for name, crop in crops.items():
        group.create_array(
            name,
            shape=(length, crop.height, crop.width),
            dtype=f"uint{footage.bits}",
            chunks=(SHARD, SHARD, SHARD),
            shards=(SHARD, _padded(crop.height), _padded(crop.width)),
            compressors=BloscCodec(cname=COMPRESSOR, clevel=1, shuffle="bitshuffle", typesize=footage.bits // 8),
            fill_value=0,
        )
    every, reduction = wanted["overview"]
    small = (footage.height // reduction, footage.width // reduction)
    group.create_array(
        OVERVIEW,
        shape=(-(-length // every), *small),
        dtype=f"uint{footage.bits}",
        chunks=(1, *small),
        compressors=BloscCodec(cname=COMPRESSOR, clevel=1, shuffle="bitshuffle", typesize=footage.bits // 8),
        fill_value=0,
    )
    group.attrs.put({**wanted, "frames": 0, "total": None, "warnings": []})
    return group


def reduced(frame: np.ndarray, times: int) -> np.ndarray:
    """A frame (H, W), so many times smaller."""
    height, width = frame.shape
    return cv2.resize(frame, (width // times, height // times), interpolation=cv2.INTER_AREA) if times > 1 else frame


def _array(group: zarr.Group, name: str) -> "zarr.Array[Any]":
    return cast("zarr.Array[Any]", group[name]).with_config(_WHOLE)


def _padded(size: int) -> int:
    return -(-size // SHARD) * SHARD


def _write_all(
    place: Location,
    group: zarr.Group,
    footage: Footage,
    crops: Mapping[str, Region],
    done: int,
    progress: Callable[[int, int | None], None] | None,
) -> None:
    """Decode in this thread, compress and write in another; at most `_WAITING` shards wait in between."""
    arrays, overview = {name: _array(group, name) for name in crops}, _array(group, OVERVIEW)
    every, reduction = cast("list[int]", group.attrs["overview"])
    expected = footage.count or None
    done -= done % SHARD
    written = done

    def write(start: int, shards: Mapping[str, np.ndarray], whole: list[np.ndarray], length: int) -> None:
        nonlocal written
        if start != written:
            return  # a shard before this one failed; counting this one would count that one too
        for name, array in arrays.items():
            if array.shape[0] < start + SHARD:
                array.resize((max(2 * array.shape[0], start + SHARD), *array.shape[1:]))
            array[start : start + SHARD] = shards[name]
            if place.local is not None:
                flush(place.local / name / "c" / str(start // SHARD) / "0" / "0")
        first = -(-start // every)
        if overview.shape[0] < first + len(whole):
            overview.resize((2 * (first + len(whole)), *overview.shape[1:]))
        for number, frame in enumerate(whole, first):
            overview[number] = reduced(frame, reduction)
            if place.local is not None:
                flush(place.local / OVERVIEW / "c" / str(number) / "0" / "0")
        written = start + length
        group.attrs.update({"frames": written})
        if progress is not None:
            progress(start + length, expected)

    with ThreadPoolExecutor(1) as writer:
        pending: deque[Future[None]] = deque()
        for shards, whole, length in _shards(footage, crops, done, every):
            if len(pending) >= _WAITING:
                pending.popleft().result()
            pending.append(writer.submit(write, done, shards, whole, length))
            done += length
        for shard in pending:
            shard.result()
    if done == 0:
        raise InputError(f"{footage.uri} holds no frame", "film or copy it again")
    for array in arrays.values():
        array.resize((done, *array.shape[1:]))
    overview.resize((-(-done // every), *overview.shape[1:]))
    group.attrs.update({"frames": done, "total": done, "warnings": list(footage.warnings)})


def _shards(
    footage: Footage, crops: Mapping[str, Region], start: int, every: int
) -> Iterator[tuple[dict[str, np.ndarray], list[np.ndarray], int]]:
    """Crops of 64 frames at a time, those of the frames that are kept whole, and how many frames these are; the last
    crops are padded with zeros."""
    windows = {name: (slice(c.y, c.y + c.height), slice(c.x, c.x + c.width)) for name, c in crops.items()}
    kind = np.dtype(f"uint{footage.bits}")
    filled, shards, whole = 0, dict[str, np.ndarray](), list[np.ndarray]()
    for number, frame in enumerate(footage.frames(start), start):
        if filled == 0:
            shards = {name: np.zeros((SHARD, crop.height, crop.width), kind) for name, crop in crops.items()}
            whole = []
        for name, window in windows.items():
            shards[name][filled] = frame[window]
        if number % every == 0:
            whole.append(frame.copy())
        filled += 1
        if filled == SHARD:
            yield shards, whole, filled
            filled = 0
    if filled:
        yield shards, whole, filled


@contextmanager
def _only_writer(location: Location, digest: str) -> Iterator[None]:
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
