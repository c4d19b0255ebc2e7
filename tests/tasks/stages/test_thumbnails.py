"""Thumbnails of a set of pictures whose levels are known."""

from pathlib import Path

import cv2
import numpy as np

from glint.storage.footage.source import open_footage
from glint.tasks.stages.thumbnails import (
    MIN_THUMBNAILS,
    NUMBERS,
    PICTURES,
    THUMBNAIL_PX,
    ThumbnailRecorder,
    thumbnail_grid,
)

WIDTH, HEIGHT = 96, 64


def draw_pictures(folder: Path, count: int) -> str:
    """Write pictures whose levels rise from left to right and are their number, modulo 100, at the left."""
    for number in range(count):
        picture = np.tile(number % 100 + np.arange(WIDTH), (HEIGHT, 1)).astype(np.uint8)
        # No two pictures are the same: copies are left out.
        picture[-1, -2:] = number // 100
        cv2.imwrite(str(folder / f"{number:04d}.png"), picture)
    return str(folder)


def test_thumbnails_are_of_every_frame_of_which_there_are_few(tmp_path: Path) -> None:
    with open_footage(draw_pictures(tmp_path, 5)) as footage:
        recorder = ThumbnailRecorder(footage)
        assert len(list(recorder.frames())) == 5
        arrays = recorder.arrays()
    assert arrays[NUMBERS].tolist() == [0, 1, 2, 3, 4]
    assert arrays[PICTURES].shape == (5, 32, THUMBNAIL_PX) and arrays[PICTURES].dtype == np.uint8
    # The level of a thumbnail's pixel is that of the frame at its middle.
    columns, rows = thumbnail_grid((32, THUMBNAIL_PX), (WIDTH, HEIGHT))
    assert np.abs(arrays[PICTURES][3] - (3.0 + columns))[:-1].max() <= 0.5
    assert (columns[0, 0], rows[0, 0]) == (0.5, 0.5) and (columns[-1, -1], rows[-1, -1]) == (94.5, 62.5)


def test_long_videos_have_at_most_twice_as_many_as_asked_for(tmp_path: Path) -> None:
    count = 2 * MIN_THUMBNAILS + 3
    with open_footage(draw_pictures(tmp_path, count)) as footage:
        recorder = ThumbnailRecorder(footage)
        # Frames that did not pass are decoded.
        arrays = recorder.arrays()
        assert len(list(recorder.frames(start=1, step=3))) == len(range(1, count, 3))
        assert np.array_equal(recorder.arrays()[NUMBERS], arrays[NUMBERS])
    assert arrays[NUMBERS].tolist() == list(range(0, count, 2))
    assert np.abs(arrays[PICTURES][:, 0, 0] - (arrays[NUMBERS] % 100 + 0.5)).max() <= 0.5
