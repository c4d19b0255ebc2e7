"""Layout of the cache of frames: names, chunks and compression of its zarr arrays."""

from collections.abc import Mapping
from typing import Any, Literal, cast

import cv2
import numpy as np
import zarr
from zarr.codecs import BloscCodec

from glint.storage.catalogue.models import Region

LAYOUT_VERSION = 2
SHARD = 64
"""Frames of a shard, and edge of a chunk in pixels and frames."""
OVERVIEW = "overview"
"""Name of the array of whole frames."""
COMPRESSOR: Literal["lz4", "zstd"] = "lz4"
"""Codec of blosc: reads several times as fast as zstd for a few per cent more bytes, since frames are mostly noise."""
_STRICT_CHUNKS: Any = {"write_empty_chunks": True, "read_missing_chunks": False}
"""Black frames are stored too, so that a missing chunk is an error and never read as black."""


def create_arrays(
    group: zarr.Group,
    length: int,
    bits: int,
    crops: Mapping[str, Region],
    interval: int,
    overview_size: tuple[int, int],
) -> None:
    """Create the arrays of the crops for `length` frames, and of whole frames (height, width), one per `interval`."""
    compressor = BloscCodec(cname=COMPRESSOR, clevel=1, shuffle="bitshuffle", typesize=bits // 8)
    for name, crop in crops.items():
        group.create_array(
            name,
            shape=(length, crop.height, crop.width),
            dtype=f"uint{bits}",
            chunks=(SHARD, SHARD, SHARD),
            shards=(SHARD, _round_up(crop.height), _round_up(crop.width)),
            compressors=compressor,
            fill_value=0,
        )
    group.create_array(
        OVERVIEW,
        shape=(-(-length // interval), *overview_size),
        dtype=f"uint{bits}",
        chunks=(1, *overview_size),
        compressors=compressor,
        fill_value=0,
    )


def open_array(group: zarr.Group, name: str) -> "zarr.Array[Any]":
    """Open an array so that missing chunks are errors."""
    return cast("zarr.Array[Any]", group[name]).with_config(_STRICT_CHUNKS)


def reduced(frame: np.ndarray, factor: int) -> np.ndarray:
    """Return a frame (H, W) reduced by `factor`, by averaging over areas."""
    if factor <= 1:
        return frame
    height, width = frame.shape
    return cv2.resize(frame, (width // factor, height // factor), interpolation=cv2.INTER_AREA)


def _round_up(size: int) -> int:
    return -(-size // SHARD) * SHARD
