"""The first pass over a video: sampled for the survey, and stored on the way where its crops are known already."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError
from glint.storage.footage.luma import eight_bits
from glint.storage.footage.source import Footage
from glint.storage.footage.wrapper import FootageWrapper
from glint.storage.frames.cache import cache_digest
from glint.storage.frames.eviction import discard_frames
from glint.tasks.algorithms.errors import UnusableFrames
from glint.tasks.algorithms.frames.frame_sample import FrameSample
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.sphere_detection import FIT_FRAMES
from glint.tasks.engine.stage import Progress
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.frames import fill_cache
from glint.tasks.stages.levels import LevelRecorder
from glint.tasks.stages.thumbnails import ThumbnailRecorder

MIN_SAMPLED_FRAMES = 3
"""Least number of sampled frames: in the temporal median of fewer, a highlight that one of them shows remains."""
MIN_BRIGHTEST = 16.0
"""Level of the brightest pixel of a video, 0 to 255, below which it shows nothing: video's black and its noise."""
SAMPLE_BYTES = 256 << 20
"""Most bytes of frames that are held in full size."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The full frame over time.

    peak: temporal maximum (H, W) float32, 0 to 255; frames: some (T, H, W) uint8; reduced: more of them, smaller.
    """

    peak: np.ndarray
    frames: np.ndarray
    reduced: FrameSample


class SampleRecorder(FootageWrapper):
    """A video that keeps the maximum of about `count` of the frames that pass, these reduced, and a few in full size.

    Of a video that holds more frames than it claims, or does not say how many, every second one that is kept is dropped
    whenever they are too many. progress: called with the number of each frame of the sample.
    """

    def __init__(self, footage: Footage, count: int, progress: Progress) -> None:
        """Watch a video."""
        super().__init__(footage)
        self._progress, expected = progress, footage.count or count
        self._first_step = max(1, expected // count)
        self._planned = expected // self._first_step
        self._most = 2 * max(self._planned, count)
        frame_bytes = footage.width * footage.height * footage.bits // 8
        self._held = max(5, min(count, FIT_FRAMES, SAMPLE_BYTES // frame_bytes))
        self._begin()

    @property
    def has_all(self) -> bool:
        """Whether the frames passed from the first one on."""
        return self._peak is not None

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .."""
        self._begin()
        for number, frame in enumerate(self._footage.frames(start, step)):
            position = start + number * step
            if start == 0 and position % self._step == 0:
                self._add(position, frame)
            yield frame

    def sample(self) -> Sample:
        """Return the sample; of frames that did not pass, in a pass of its own.

        Raises:
            InputError: the video holds no frame; UnusableFrames: it holds too few.
        """
        if not self.has_all:
            for _ in self.frames(step=self._step):
                pass
        if self._peak is None:
            raise InputError(f"{self.uri} holds no frame", "record or copy it again")
        if (sampled := self._reduced.count) < MIN_SAMPLED_FRAMES:
            frames = "1 frame" if sampled == 1 else f"{sampled} frames"
            reasons = "".join(f" ({warning})" for warning in self.warnings)
            raise UnusableFrames(
                f"{self.uri} holds {frames}, too few to separate highlights from what is always bright{reasons}",
                "record a sweep of the light, or take a few dozen photographs, each with the light elsewhere",
            )
        scale = np.float32(1.0 if self.bits == 8 else 1.0 / 257.0)
        brightest = float(self._peak.max() * scale)
        if brightest < MIN_BRIGHTEST:
            message = f"{self.uri} is dark: its brightest pixel has the level {brightest:.0f} of 255"
            remedy = "take the cap off the lens, light the object, or expose so that highlights clip"
            if self.bits > 8 and self._footage.names:
                message += f" ({self._peak.max()} of 65,535)"
                remedy = f"if its images have 12 bits or fewer, multiply them by 16 or more; else {remedy}"
            raise UnusableFrames(message, remedy)
        some = eight_bits(spread(np.stack(self._kept), FIT_FRAMES))
        return Sample(self._peak.astype(np.float32) * scale, some, self._reduced)

    def _begin(self) -> None:
        self._step = self._first_step
        self._kept_step = self._step * max(1, -(-self._planned // self._held))
        self._peak: np.ndarray | None = None
        self._kept: list[np.ndarray] = []
        self._reduced = FrameSample(self.height, self.width, self._planned if self.count else self._most)

    def _add(self, position: int, frame: np.ndarray) -> None:
        self._peak = frame.copy() if self._peak is None else np.maximum(self._peak, frame, out=self._peak)
        if position % self._kept_step == 0:
            self._kept.append(frame.copy())
        self._reduced.add(frame)
        self._progress(position, self.count or None)
        if self._reduced.count > self._most or self._reduced.is_full:
            self._reduced.halve()
            self._step *= 2
        # Frames are kept of those that are sampled.
        while len(self._kept) > self._held + 1 or self._kept_step % self._step:
            self._kept = self._kept[::2]
            self._kept_step *= 2


def sampled_and_stored(
    inputs: StageInputs, footage: Footage, count: int, crops: Mapping[str, Region], progress: Progress
) -> tuple[Sample, Mapping[str, np.ndarray]]:
    """Return a sample of about `count` frames, and arrays of `frames`, of a pass that fills the cache of frames.

    crops: by name, in pixels of the full frame.

    Raises:
        InputError: the video cannot be read; StoreError: the store cannot be written.
    """
    recorder = SampleRecorder(footage, count, progress)
    thumbnails = ThumbnailRecorder(recorder)
    levels = LevelRecorder(thumbnails, crops[OBJECT])
    cache = fill_cache(inputs, _digest(inputs, crops), crops, levels)
    if not recorder.has_all:
        # The cache, or its beginning, was there.
        for _ in thumbnails.frames():
            pass
    return recorder.sample(), {**thumbnails.arrays(), **levels.arrays(cache)}


def discard_stored(inputs: StageInputs, crops: Mapping[str, Region]) -> None:
    """Remove what `sampled_and_stored` stored of crops that turned out to be wrong."""
    discard_frames(inputs.location, _digest(inputs, crops))


def _digest(inputs: StageInputs, crops: Mapping[str, Region]) -> str:
    return cache_digest(inputs.digest("frames") or "", crops)
