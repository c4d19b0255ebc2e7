"""Tiles into which the pixels of a region are cut, so that several workers can share them."""

from collections.abc import Iterator

TILE_PX = 64
"""Edge of a tile in pixels: that of the chunks of frames."""
TILE_BYTES = 96 << 20
"""Most bytes of frames that one tile holds."""

Tile = tuple[slice, slice]


def tiles_of(shape: tuple[int, ...], pixel_bytes: int) -> Iterator[Tile]:
    """Yield tiles of a region (H, W) of `pixel_bytes` over all frames: whole rows of chunks, or less for memory.

    Chunks are 64 pixels wide; a video so long that one of them exceeds the memory of a tile is cut finer.
    """
    height, width = shape
    tall = TILE_PX
    while tall > 1 and tall * min(TILE_PX, width) * pixel_bytes > TILE_BYTES:
        tall //= 2
    wide = TILE_PX * max(1, min(-(-width // TILE_PX), TILE_BYTES // (tall * TILE_PX * pixel_bytes)))
    for top in range(0, height, tall):
        for left in range(0, width, wide):
            yield slice(top, min(top + tall, height)), slice(left, min(left + wide, width))
