"""Background and peak level of the object's region, and how much of each frame clips: taken while frames are stored."""

from collections.abc import Iterator, Mapping

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import Footage
from glint.storage.footage.wrapper import FootageWrapper
from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.lighting.occlusion import clipped_pixels
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.engine.stage_inputs import CaptureResults
from glint.tasks.stages.capture_geometry import OBJECT

LEVEL_RUNS, LEVEL_FRAMES = 24, 64
"""Most runs of frames from which background and peak level are taken, and the frames of one."""
MEDIAN_STEP = 16
"""Frames of a run from one that counts in the median to the next: neighbouring frames are alike."""
BACKGROUND, PEAK, CLIPPED = "background", "peak", "clipped"
"""Arrays of the stage `frames`: levels (H, W) of the frames' dtype, and (T, 2) uint32, see `clipped_pixels`."""


class LevelRecorder(FootageWrapper):
    """A video that keeps the levels of a region, and counts its clipped pixels, as its frames pass."""

    def __init__(self, footage: Footage, region: Region) -> None:
        """Watch a video."""
        super().__init__(footage)
        self._window = region.rows, region.columns
        self._clipped: list[tuple[int, int]] = []
        self._levels = _Levels(footage.count)
        self._is_complete = False

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .."""
        is_whole_pass = start == 0 and step == 1
        if is_whole_pass:
            self._clipped, self._levels, self._is_complete = [], _Levels(self.count), False
        for number, frame in enumerate(self._footage.frames(start, step)):
            if is_whole_pass:
                self._clipped.append(clipped_pixels(frame[self._window]))
                self._levels.add(number, frame[self._window])
            yield frame
        self._is_complete = self._is_complete or is_whole_pass

    def arrays(self, cache: FrameCache) -> Mapping[str, np.ndarray]:
        """Return the arrays to save; of frames that did not pass, since they were stored, by reading the cache.

        Raises:
            StoreError: it cannot be read.
        """
        if not self._is_complete or not len(self._clipped) == self.count == cache.frames:
            return stored_levels(cache)
        background, peak = self._levels.background_and_peak()
        return {BACKGROUND: background, PEAK: peak, CLIPPED: np.array(self._clipped, np.uint32)}


def stored_levels(cache: FrameCache) -> dict[str, np.ndarray]:
    """Return the arrays of a cache of frames that was filled before.

    Raises:
        StoreError: it cannot be read.
    """
    background, peak = levels(cache)
    clipped = [
        clipped_pixels(frame)
        for start in range(0, cache.frames, cache.shard_frames)
        for frame in cache.read(OBJECT, slice(start, start + cache.shard_frames))
    ]
    return {BACKGROUND: background, PEAK: peak, CLIPPED: np.array(clipped, np.uint32)}


def levels(cache: FrameCache, crop: str = OBJECT) -> tuple[np.ndarray, np.ndarray]:
    """Compute background level (temporal median) and peak level (temporal maximum) (H, W) of a crop.

    Raises:
        StoreError: the cache cannot be read.
    """
    sampled = _Levels(cache.frames)
    for start in spread_runs(cache.frames, LEVEL_RUNS):
        for number, frame in enumerate(cache.read(crop, slice(start, start + LEVEL_FRAMES)), start):
            sampled.add(number, frame)
    return sampled.background_and_peak()


def load_levels(results: CaptureResults) -> tuple[np.ndarray, np.ndarray]:
    """Load background and peak level (H, W) of the object's region, of the frames' dtype."""
    stored = results.load("frames")
    return stored.read(BACKGROUND), stored.read(PEAK)


def spread_runs(frames: int, count: int) -> list[int]:
    """Return the first frames of at most `count` runs of LEVEL_FRAMES frames, spread evenly over so many frames."""
    return [int(start) for start in spread(np.arange(0, frames, LEVEL_FRAMES), count)]


class _Levels:
    """Median and maximum of frames that are added in their order; those that neither needs are ignored."""

    def __init__(self, count: int) -> None:
        starts = np.array(spread_runs(count, LEVEL_RUNS) if count else [], int)
        step = max(1, min(MEDIAN_STEP, count // LEVEL_FRAMES))
        self._for_peak = {int(number) for start in starts for number in range(start, start + LEVEL_FRAMES)}
        self._for_median = {int(number) for start in starts for number in range(start, start + LEVEL_FRAMES, step)}
        self._kept: list[np.ndarray] = []
        self._peak: np.ndarray | None = None

    def add(self, number: int, frame: np.ndarray) -> None:
        if number in self._for_peak:
            self._peak = frame.copy() if self._peak is None else np.maximum(self._peak, frame, out=self._peak)
        if number in self._for_median:
            self._kept.append(frame.copy())

    def background_and_peak(self) -> tuple[np.ndarray, np.ndarray]:
        assert self._peak is not None
        stack = np.stack(self._kept)
        # The lower of the two middle values, so that the level is one that was seen.
        middle = (len(stack) - 1) // 2
        return np.partition(stack, middle, axis=0)[middle], self._peak
