"""Layout of the cache of frames: names, chunks and compression of its zarr arrays."""

from collections.abc import Mapping
from typing import Any, Literal, cast

import zarr
from zarr.codecs import BloscCodec, Crc32cCodec

from glint.storage.catalogue.models import Region
from glint.storage.seals import digest_of

LAYOUT_VERSION = 5
CHUNK_PX = 64
"""Edge of a chunk in pixels; it holds all frames of its shard."""
SHARD_FRAMES, MAX_SHARD_FRAMES, MIN_SHARD_FRAMES = 64, 128, 8
"""Frames of a shard: as a rule, of small crops, and of crops so large that memory is short. Longer ones would save more
requests, and cost more bytes where 64 frames in a row are read."""
SMALL_SHARD_BYTES, MAX_SHARD_BYTES = 32 << 20, 512 << 20
"""Uncompressed size up to which shards are made longer, for fewer requests; and beyond which they are made shorter."""
MIN_SHARDS = 4
"""Least number of shards into which a video is cut that longer ones would hold: what a crash loses is one of them."""
COMPRESSOR: Literal["lz4", "zstd"] = "lz4"
"""Codec of blosc: reads several times as fast as zstd for a few per cent more bytes, since frames are mostly noise."""
_PIPELINE = "zarr.core.codec_pipeline.FusedCodecPipeline"
"""Reads and writes the chunks of a shard in one thread; zarr's default takes several steps of an event loop for each,
which cost more than the chunk."""
_STRICT_CHUNKS: Any = {"write_empty_chunks": True, "read_missing_chunks": False}
"""Black frames are stored too, so that a missing chunk is an error and never read as black."""


def shard_frames(crops: Mapping[str, Region], bits: int, count: int) -> int:
    """Return the number of frames of a shard, for a video of `count` frames (0: unknown)."""
    frame_bytes = sum(_round_up(crop.height) * _round_up(crop.width) for crop in crops.values()) * bits // 8
    length = SHARD_FRAMES
    while 2 * length <= min(MAX_SHARD_FRAMES, count // MIN_SHARDS) and 2 * length * frame_bytes <= SMALL_SHARD_BYTES:
        length *= 2
    while length > MIN_SHARD_FRAMES and length * frame_bytes > MAX_SHARD_BYTES:
        length //= 2
    return length


def create_arrays(group: zarr.Group, length: int, bits: int, crops: Mapping[str, Region], shard: int) -> None:
    """Create the arrays of the crops for `length` frames, `shard` of them in each shard."""
    compressor = BloscCodec(cname=COMPRESSOR, clevel=1, shuffle="bitshuffle", typesize=bits // 8)
    for name, crop in crops.items():
        group.create_array(
            name,
            shape=(length, crop.height, crop.width),
            dtype=f"uint{bits}",
            chunks=(shard, CHUNK_PX, CHUNK_PX),
            shards=(shard, _round_up(crop.height), _round_up(crop.width)),
            compressors=(compressor, Crc32cCodec()),
            fill_value=0,
        )


def open_array(group: zarr.Group, name: str) -> "zarr.Array[Any]":
    """Open an array so that missing chunks are errors."""
    with zarr.config.set({"codec_pipeline.path": _PIPELINE}):
        return cast("zarr.Array[Any]", group[name]).with_config(_STRICT_CHUNKS)


def chunks_of(crops: Mapping[str, Region]) -> dict[str, int]:
    """Return the number of chunks of a shard by array."""
    return {name: _round_up(crop.height) * _round_up(crop.width) // CHUNK_PX**2 for name, crop in crops.items()}


def metadata_digests(group: zarr.Group, crops: Mapping[str, Region]) -> dict[str, str]:
    """Return digests of what zarr knows of the arrays of the crops but their length, which grows."""
    metadata = {name: group[name].metadata.to_dict() for name in crops}
    for values in metadata.values():
        values["shape"] = list(cast("Any", values["shape"]))[1:]
    return {name: digest_of(values) for name, values in metadata.items()}


def _round_up(size: int) -> int:
    return -(-size // CHUNK_PX) * CHUNK_PX
