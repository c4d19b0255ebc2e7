"""Tiles into which the pixels of a region are cut, so that several workers can share them."""

from collections.abc import Iterator

TILE_PX = 64
"""Edge of a tile in pixels: that of the chunks of frames."""
TILE_BYTES = 96 << 20
"""Most bytes of frames that one tile holds."""

MIN_TILES = 4
"""Least number of tiles of a region that has so many chunks, so that several workers can share them."""

Tile = tuple[slice, slice]


def tiles_of(shape: tuple[int, ...], pixel_bytes: int) -> Iterator[Tile]:
    """Yield tiles of a region (H, W) of `pixel_bytes` over all frames.

    A tile is 64 x 64 pixels, doubled in height and width by turns as long as its memory and the number of tiles allow.
    So its chunks lie side by side in the file: zarr writes them in Morton order, and reads what lies between two chunks
    along with them. A video so long that one chunk exceeds the memory of a tile is cut finer.
    """
    height, width = shape
    tall = wide = TILE_PX
    while tall > 1 and tall * min(wide, width) * pixel_bytes > TILE_BYTES:
        tall //= 2
    while tall >= TILE_PX:
        larger = (2 * tall, wide) if tall == wide else (tall, 2 * wide)
        if larger[0] * larger[1] * pixel_bytes > TILE_BYTES or _count(shape, larger) < MIN_TILES:
            break
        tall, wide = larger
    for top in range(0, height, tall):
        for left in range(0, width, wide):
            yield slice(top, min(top + tall, height)), slice(left, min(left + wide, width))


def _count(shape: tuple[int, ...], tile: tuple[int, int]) -> int:
    return -(-shape[0] // tile[0]) * -(-shape[1] // tile[1])
