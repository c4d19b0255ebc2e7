"""Cache of a capture's frames, cropped and cut into chunks that are cheap to read over time: STORE/frames/<digest>/.

A zarr group with one array (T, height, width) per crop: `object`, `sphere-0`, ... As a cache it can be rebuilt, and an
interrupted one is continued at its last whole shard (see `ingest`). Each shard is written whole and once, and is on the
disk before the group's attributes count it. All that is read is verified: the attributes are sealed (`sealed`), and
list places and checksums of all chunks (`shard_store`).
"""

from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
import zarr

from glint.storage.catalogue.models import Region
from glint.storage.errors import InputError, StoreError
from glint.storage.footage.source import Footage
from glint.storage.frames.errors import DamagedFrames
from glint.storage.frames.ingest import check_crops, open_group, write_frames, writer_lock
from glint.storage.frames.layout import LAYOUT_VERSION, chunks_of, metadata_digests, open_array
from glint.storage.frames.shard_store import ShardStore
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of, is_sealed

_ALL = slice(None)
_UNREADABLE = (
    LookupError, ValueError, TypeError, AttributeError, RuntimeError, FileNotFoundError, ExceptionGroup,
)  # fmt: skip
"""Errors that zarr raises for arrays that are damaged, or that are no arrays."""


def cache_digest(footage: str, crops: Mapping[str, Region]) -> str:
    """Return the name of the cache of these crops of the footage with this content digest."""
    boxes = {name: crop.model_dump() for name, crop in crops.items()}
    return digest_of({"footage": footage, "layout": LAYOUT_VERSION, "crops": boxes})


class FrameCache:
    """Frames that were ingested.

    shard_frames: number of frames that are stored together; frames: number of frames so far; total: number of all
    frames, None until known; bits: 8 or 16; crops: by array, in pixels of the full frame; frame_size: (height, width)
    of the full frame; warnings: damage met while reading the video or images.
    """

    def __init__(self, location: Location, digest: str, group: zarr.Group) -> None:
        self.location, self.digest, self._group = location, digest, group
        self._arrays: dict[str, Any] = {}
        attributes: dict[str, Any] = dict(group.attrs)
        try:
            if attributes["layout"] != LAYOUT_VERSION:
                raise DamagedFrames(f"the frames at {location.uri} have layout {attributes['layout']}", digest=digest)
            if not is_sealed(attributes) or attributes["name"] != digest:
                raise DamagedFrames(f"the attributes of the frames at {location.uri} are damaged", digest=digest)
            self.frames = int(cast(int, attributes["frames"]))
            self.total = cast("int | None", attributes["total"])
            self.bits = int(cast(int, attributes["bits"]))
            self.shard_frames = int(cast(int, attributes["shard_frames"]))
            height, width = cast("list[int]", attributes["frame_size"])
            self.frame_size = (int(height), int(width))
            crops = cast("dict[str, dict[str, int]]", attributes["crops"])
            self.crops = {name: Region(**crop) for name, crop in crops.items()}
            self.warnings = tuple(str(text) for text in cast("list[str]", attributes["warnings"]))
            self.indices: dict[str, str] = attributes["indices"]
            self._metadata: dict[str, str] = attributes["arrays"]
        except (KeyError, TypeError, ValueError) as error:
            raise DamagedFrames(f"the attributes of the frames at {location.uri} are damaged", digest=digest) from error
        self._store = ShardStore(location.zarr_store(read_only=True), chunks_of(self.crops), self.indices)

    @property
    def complete(self) -> bool:
        """True if it holds all frames of the footage."""
        return self.total is not None and self.frames == self.total

    @classmethod
    def open(cls, location: Location, digest: str) -> "FrameCache":
        """Open the cache as it is, complete or not.

        Raises:
            StoreError: missing; DamagedFrames: its attributes are damaged.
        """
        folder = location.child("frames", digest)
        with store_errors(folder.uri, "opening frames"):
            try:
                store = folder.zarr_store(read_only=True)
                return cls(folder, digest, zarr.open_group(store, mode="r", use_consolidated=False))
            except FileNotFoundError as error:
                raise StoreError(f"there are no frames at {folder.uri}", "run the capture's frames first") from error
            except (ValueError, TypeError, LookupError) as error:
                raise DamagedFrames(
                    f"the attributes of the frames at {folder.uri} are damaged", digest=digest
                ) from error

    @classmethod
    def ingest(
        cls,
        footage: Footage,
        location: Location,
        digest: str,
        crops: Mapping[str, Region],
        progress: Callable[[int, int | None], None] | None = None,
        source: Callable[[], Any] = lambda: None,
    ) -> "FrameCache":
        """Complete the cache; nothing is read from the footage if it is complete already.

        progress: called with (frames done, frames expected or None) after each shard. source: returns what tells the
        footage's files from others (JSON), as `input_stamps`; asked before and after they are read.

        Raises:
            InputError: the footage cannot be read or has no frame, it changed while it was read, or a crop leaves the
                frame.
            StoreError: the store cannot be written.
        """
        check_crops(crops, footage)
        folder = location.child("frames", digest)
        with store_errors(folder.uri, "writing frames"), writer_lock(location, digest):
            stamps = source()
            group = open_group(folder, footage, crops, stamps)
            cache = cls(folder, digest, group)
            if not cache.complete:
                writer = write_frames(folder, group, footage, crops, cache.frames, progress)
                if not _is_same(source, stamps):
                    # The cache is named by the files as they were: frames of others must not stay in it.
                    group.attrs.clear()
                    raise InputError(f"{footage.uri} changed while it was read", "run again once it is complete")
                writer.finish(list(footage.warnings))
        return cls.open(location, digest)

    def read(self, name: str, frames: slice = _ALL, rows: slice = _ALL, columns: slice = _ALL) -> np.ndarray:
        """Read a crop, uint8 or uint16 (T, h, w); whole shards, or multiples of 64 pixels, are the cheapest.

        Raises:
            StoreError: no such crop, or it cannot be read; DamagedFrames: it is damaged.
        """
        if name not in self.crops:
            raise StoreError(f"{self.location.uri} has no frames of {name!r}", f"there are {', '.join(self.crops)}")
        start, stop, step = frames.indices(self.frames)
        return self._read(name, (slice(start, stop, step), rows, columns))

    def _read(self, name: str, index: tuple[slice, ...]) -> np.ndarray:
        with store_errors(self.location.uri, f"reading frames of {name}"):
            try:
                if name not in self._arrays:
                    self._arrays[name] = self._open(name)
                return np.asarray(self._arrays[name][index])
            except _UNREADABLE as error:
                message = f"the frames of {name} at {self.location.uri} are damaged"
                raise DamagedFrames(message, digest=self.digest) from error

    def _open(self, name: str) -> Any:
        """Open an array, if it is the one that was created.

        Raises:
            ValueError: it is another.
        """
        group = zarr.open_group(self._store, mode="r", use_consolidated=False)
        array, crop = open_array(group, name), self.crops[name]
        is_long_enough = array.shape[0] == self.total or (self.total is None and array.shape[0] >= self.frames)
        if not is_long_enough or array.shape[1:] != (crop.height, crop.width):
            raise ValueError(f"{name} has the shape {array.shape}")
        if metadata_digests(group, {name: crop}) != {name: self._metadata[name]}:
            raise ValueError(f"the metadata of {name} is not what was written")
        return array


def _is_same(source: Callable[[], Any], stamps: Any) -> bool:
    try:
        return bool(source() == stamps)
    except InputError:
        return False
