"""Tiles: all pixels once, within the memory of a tile, and no byte of the frames read in vain."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location
from glint.tasks.engine.tiles import MIN_TILES, TILE_BYTES, TILE_PX, tiles_of
from tests.storage.footage.videos import write_video


@pytest.mark.parametrize("shape", [(251, 221), (64, 64), (40, 900), (1300, 700), (5, 5)])
@pytest.mark.parametrize("pixel_bytes", [300, 2_000, 8_000, 100_000])
def test_every_pixel_is_in_one_tile_of_bounded_memory(shape: tuple[int, int], pixel_bytes: int) -> None:
    count = np.zeros(shape, int)
    tiles = list(tiles_of(shape, pixel_bytes))
    for rows, columns in tiles:
        count[rows, columns] += 1
        assert (rows.stop - rows.start) * (columns.stop - columns.start) * pixel_bytes <= TILE_BYTES
    assert (count == 1).all()
    if min(shape) >= 2 * TILE_PX:
        assert len(tiles) >= MIN_TILES, "several workers share them"


@pytest.mark.parametrize("pixel_bytes", [300, 8_000])
def test_reading_all_tiles_reads_what_is_stored_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pixel_bytes: int
) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (64, 256, 320), np.uint8)
    video = write_video(tmp_path / "video.mkv", list(noise), "ffv1", "gray")
    region = Region(x=0, y=0, width=320, height=256)
    with open_footage(video) as footage:
        cache = FrameCache.ingest(footage, Location.parse(tmp_path / "store"), "digest", {"object": region})
    stored = sum(path.stat().st_size for path in (tmp_path / "store").rglob("c/*/*/*"))
    read = list[int]()
    store: Any = type(cache._store._store)
    get = store.get_sync

    def counted(self: Any, *arguments: Any, **options: Any) -> Any:
        value = get(self, *arguments, **options)
        read.append(0 if value is None else len(value))
        return value

    monkeypatch.setattr(store, "get_sync", counted)
    for rows, columns in tiles_of((256, 320), pixel_bytes):
        cache.read("object", rows=rows, columns=columns)
    assert stored > noise.size * 0.9
    assert stored * 0.95 < sum(read) < stored * 1.05
