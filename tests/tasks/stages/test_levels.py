"""Background and peak level of a region, and clipped pixels, of pictures whose levels are known."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.lighting.occlusion import clipped_pixels
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, LEVEL_FRAMES, LEVEL_RUNS, PEAK, LevelRecorder, spread_runs


@pytest.mark.parametrize("frames", [1, LEVEL_FRAMES, LEVEL_FRAMES + 1, LEVEL_RUNS * LEVEL_FRAMES, 5_000, 20_001])
def test_runs_are_spread_from_the_first_frame_to_the_last(frames: int) -> None:
    starts = spread_runs(frames, LEVEL_RUNS)
    assert starts[0] == 0 and frames - LEVEL_FRAMES <= starts[-1] < frames
    assert len(starts) == min(LEVEL_RUNS, -(-frames // LEVEL_FRAMES))
    gaps = np.diff(starts)
    assert (gaps >= LEVEL_FRAMES).all() and (not len(gaps) or np.ptp(gaps) <= LEVEL_FRAMES)


def test_levels_are_those_of_the_region_in_the_frames_that_pass(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    pictures = generator.integers(0, 250, (6, 20, 30)).astype(np.uint8)
    pictures[4, 8:10, 12:15] = 255
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture)
    region = Region(x=10, y=5, width=16, height=12)
    shown = pictures[:, region.rows, region.columns]
    with open_footage(str(tmp_path)) as footage:
        recorder = LevelRecorder(footage, region)
        for start in (2, 0, 2):
            list(recorder.frames(start=start))
        # Of a cache that holds as many frames as have passed nothing else is read.
        cache = FrameCache.__new__(FrameCache)
        cache.frames = 6
        arrays = recorder.arrays(cache)
    assert np.array_equal(arrays[PEAK], shown.max(axis=0))
    assert np.array_equal(arrays[BACKGROUND], np.sort(shown, axis=0)[2]), "the lower of the two middle ones"
    assert arrays[CLIPPED].tolist() == [list(clipped_pixels(picture)) for picture in shown]
    assert arrays[CLIPPED][4].max() >= 6
