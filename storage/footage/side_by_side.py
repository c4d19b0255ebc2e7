"""Decode parts of a video side by side, and yield exactly the frames of one pass over it.

FFmpeg's own threads wait for each other several times in every frame, and gain little where frames are small. Here each
part has a decoder of its own (see `parts`). That the parts join is checked: every packet must give one undamaged frame,
at its time and in order, and the decoder of each part goes on until it has the first frame of the next part, which must
be the same as the other decoder's.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import chain, islice, pairwise
from queue import SimpleQueue
from typing import Any

import av
import numpy as np

from glint.storage.footage.luma import LumaConverter
from glint.storage.footage.parts import HELD_BYTES, Part, parts_of

MIN_PART_FRAMES = 24
"""Shorter parts are joined: each costs the frames at its end that are decoded twice."""
_OVERLAP_PACKETS = 32
"""Packets of the next part that are decoded for its first frame: more than any decoder holds back."""
_BATCH_FRAMES = 8
"""Frames that are handed over at a time."""

type TimedLuma = tuple[np.ndarray | None, float]
"""Luma (H, W) of a frame, None where it is not wanted, and its time in seconds."""


@dataclass(eq=False)
class _Job:
    """A part in the hands of a decoder.

    after: the next part; batches: frames, ended by None; is_sound: whether all were as expected; first: its first
    frame; first_after: what its decoder has for the first frame of the next part.
    """

    part: Part
    after: Part | None
    batches: SimpleQueue[list[TimedLuma] | None] = field(default_factory=SimpleQueue)
    is_sound: bool = False
    first: np.ndarray | None = None
    first_after: np.ndarray | None = None


class SideBySide:
    """The frames of a video by several decoders; `is_complete`: whether `frames` has yielded all."""

    def __init__(self, containers: Sequence[Any], shape: tuple[int, int], bits: int) -> None:
        """Prepare to decode frames of `shape` (height, width) whose stream is divisible.

        containers: of the same file, each just opened; there are as many decoders.
        """
        self._container, self._shape, self._count = containers[0], shape, len(containers)
        self._streams = [container.streams.video[0] for container in containers]
        self._most = HELD_BYTES // (shape[0] * shape[1] * bits // 8) // (self._count + 1)
        self._contexts = SimpleQueue[Any]()
        self._stopped = threading.Event()
        self.is_complete = False

    def frames(self, is_wanted: Callable[[int], bool]) -> Iterator[TimedLuma]:
        """Yield the frames from the first one on, until all are decoded or something is not as expected.

        is_wanted: whether the frame of a number is converted to luma.
        """
        for context in (stream.codec_context for stream in self._streams):
            # How a damaged picture is concealed depends on the threads: here damage is an error.
            context.thread_count, context.options = 1, {"err_detect": "explode"}
            self._contexts.put(context)
        jobs, waiting, expected = self._jobs(), deque[_Job](), None
        with ThreadPoolExecutor(self._count, "decoding") as executor:
            try:
                while True:
                    for job in islice(jobs, self._count + 1 - len(waiting)):
                        waiting.append(job)
                        executor.submit(self._decode, job, is_wanted)
                    if not waiting:
                        self.is_complete = expected is None
                        return
                    job = waiting.popleft()
                    while (batch := job.batches.get()) is not None:
                        if not _is_same(expected, job.first):
                            return
                        expected = None
                        yield from batch
                    if not job.is_sound:
                        return
                    expected = job.first_after
            except (ValueError, av.FFmpegError):
                return
            finally:
                self._stopped.set()

    def _jobs(self) -> Iterator[_Job]:
        """Yield a job for each part.

        Raises:
            ValueError: the packets cannot be divided, or are one part; av.FFmpegError: they cannot be read.
        """
        parts = parts_of(self._container.demux(self._streams[0]), self._streams[0], MIN_PART_FRAMES, self._most)
        part: Part | None = None
        for part, after in pairwise(chain(parts, [None])):
            assert part is not None
            if part.start > 0 or after is not None:
                yield _Job(part, after)
        if part is None or part.start == 0:
            raise ValueError("one part")

    def _decode(self, job: _Job, is_wanted: Callable[[int], bool]) -> None:
        """Decode a part with a decoder that is free."""
        context = self._contexts.get()
        try:
            job.is_sound = self._has_decoded(job, context, is_wanted)
            context.flush_buffers()
        except av.FFmpegError:
            job.is_sound = False
        finally:
            self._contexts.put(context)
            job.batches.put(None)

    def _has_decoded(self, job: _Job, context: Any, is_wanted: Callable[[int], bool]) -> bool:
        """Decode a part and the first frame after it; return whether all was as expected."""
        part, after = job.part, job.after
        times = part.times + (after.times[:1] if after else [])
        beyond = after.packets[:_OVERLAP_PACKETS] if after else []
        batch, converter, done = list[TimedLuma](), None, 0
        for packet in chain(part.packets, beyond, [None]):
            for frame in context.decode(packet):
                if converter is None or not converter.is_same_format(frame):
                    converter = LumaConverter(frame)
                if done == len(times) or frame.pts != times[done] or frame.is_corrupt or converter.shape != self._shape:
                    return False
                if done == len(part.times):
                    job.first_after = converter.convert(frame)
                    job.batches.put(batch)
                    return True
                is_kept = is_wanted(part.start + done)
                luma = converter.convert(frame) if is_kept or done == 0 else None
                if done == 0:
                    job.first = luma
                batch.append((luma if is_kept else None, float(frame.time)))
                done += 1
                if len(batch) == _BATCH_FRAMES:
                    job.batches.put(batch)
                    batch = []
            if self._stopped.is_set():
                return False
        job.batches.put(batch)
        return done == len(times)


def _is_same(expected: np.ndarray | None, frame: np.ndarray | None) -> bool:
    """Return whether a frame is the expected one, if one is expected."""
    return expected is None or (frame is not None and np.array_equal(expected, frame))
