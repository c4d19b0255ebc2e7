"""The time that a run has left, from the work of each stage and from the speed that the run itself has shown.

The work of a stage is what it took for a capture of the paper's size (docs/sizing.md): a part that grows with the
frames, and a part that does not. The speed is measured: seconds for each unit of work, of each stage that has ended in
this run, and of all of them for the stages that have not. Before anything is measured, no time is given.
"""

import threading
import time
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

from glint.flows.reporting.events import (
    CaptureEnded,
    CaptureFailed,
    Event,
    RunProgress,
    StageEnded,
    StageProgress,
    StageStarted,
)

MS_PER_FRAME = {"frames": 1.0, "lights": 0.08, "clusters": 0.4}
"""Work of the stages that grow with the length of the video: processor milliseconds of a frame of 251 x 221 pixels."""
MS = {"survey": 50.0, "mask": 30.0, "silhouette": 100.0, "labels": 1900.0, "depth": 200.0, "surface": 500.0}
"""Work that does not grow with it: processor milliseconds of an object of 251 x 221 pixels."""
OTHER_MS = 30.0
"""Work of the other stages."""
MIN_SHARE = 0.05
"""Part of a stage from which its own progress says how long it takes."""
MAX_SHARE = 0.99
"""Part of its time that a capture in progress has behind it at most: what is left may be less than is known."""
MIN_SECONDS = 1.0
"""Seconds after which a stage's own progress counts; also the interval of reports about the run."""
MIN_WORK_MS = 500.0
"""Work that is measured before a speed is known: what is shorter is mostly the start of its stage."""


@dataclass(slots=True)
class _Capture:
    """A capture in progress: its start, frames, finished stages and current stage."""

    began: float = 0.0
    frames: int | None = None
    ended: set[str] = field(default_factory=set)
    stage: str = ""
    started: float = 0.0
    share: float = 0.0


class TimeLeft:
    """Follows the events of a run and says how long its captures, and the run, still take. Safe for threads.

    stages: names of the stages of a capture in their order.
    """

    def __init__(self, stages: Sequence[str]) -> None:
        self._stages, self._lock = tuple(stages), threading.Lock()
        self._expected, self._done = set[str](), set[str]()
        self._captures = dict[str, _Capture]()
        self._seconds, self._work = defaultdict[str, float](float), defaultdict[str, float](float)
        self._frames, self._lanes, self._reported = list[int](), 1, 0.0

    def expect(self, captures: Collection[str], unchanged: Collection[str] = ()) -> None:
        """Name the captures of the run, and those of them that need no processing."""
        with self._lock:
            self._expected, self._done = set(captures), set(unchanged)

    def follow(self, event: Event, now: float | None = None) -> Iterator[Event]:
        """Yield the event with its capture's seconds left, where they are known, and at intervals the run's."""
        now = time.monotonic() if now is None else now
        with self._lock:
            self._update(event, now - getattr(event, "age", 0.0))
            if isinstance(event, StageProgress) and event.capture in self._captures:
                event = self._with_time_left(event, self._captures[event.capture], now)
            is_end = isinstance(event, CaptureEnded | CaptureFailed) and event.capture in self._expected
            is_due = bool(self._captures) and now - self._reported >= MIN_SECONDS
            is_cached = isinstance(event, CaptureEnded) and bool(event.cached)
            is_reported = len(self._expected) > 1 and (is_due or (is_end and not is_cached))
            report = self._report(now) if is_reported else None
        yield event
        if report is not None:
            yield report

    def report(self) -> RunProgress:
        """Return the progress of the run."""
        with self._lock:
            return self._report(time.monotonic())

    def _update(self, event: Event, now: float) -> None:
        match event:
            case StageStarted() if event.stage in self._stages:
                capture = self._captures.setdefault(event.capture, _Capture(now))
                capture.stage, capture.started, capture.share = event.stage, now, 0.0
                self._lanes = max(self._lanes, len(self._captures))
            case StageProgress() if event.capture in self._captures:
                capture = self._captures[event.capture]
                if event.total:
                    capture.share = min(1.0, event.done / event.total)
                    if event.stage == "frames":
                        capture.frames = event.total
            case StageEnded() if event.capture in self._captures:
                capture = self._captures[event.capture]
                capture.frames = event.frames or capture.frames
                capture.ended.add(event.stage)
                capture.stage = ""
                if not event.cached and capture.frames is not None:
                    self._seconds[event.stage] += event.seconds
                    self._work[event.stage] += _work(event.stage, capture.frames)
            case CaptureEnded() | CaptureFailed():
                self._done.add(event.capture)
                ended = self._captures.pop(event.capture, None)
                if ended is not None and ended.frames is not None:
                    self._frames.append(ended.frames)

    def _with_time_left(self, event: StageProgress, capture: _Capture, now: float) -> StageProgress:
        left, passed = self._left(capture, now), now - capture.began
        if left is None:
            return event
        return replace(event, seconds_left=round(left, 1), share=round(min(MAX_SHARE, passed / (passed + left)), 3))

    def _report(self, now: float) -> RunProgress:
        self._reported = now
        names = self._expected | self._captures.keys()
        return RunProgress(len(names & self._done), len(names), _rounded(self._left_of_run(names, now)))

    def _left_of_run(self, names: Collection[str], now: float) -> float | None:
        """Return the seconds until the last capture ends, as many side by side as there have been; None: not known."""
        running = [self._left(capture, now) for capture in self._captures.values()]
        known = [seconds for seconds in running if seconds is not None]
        # A capture whose length is not known yet counts as one that has not begun.
        waiting = len(names) - len(known) - len(self._done.intersection(names))
        lengths = self._frames + [capture.frames for capture in self._captures.values() if capture.frames]
        if waiting:
            whole = self._left(_Capture(now, sum(lengths) // len(lengths)), now) if lengths else None
            if whole is None:
                return None
            known += [whole] * waiting
        return max(sum(known) / self._lanes, max(known, default=0.0))

    def _left(self, capture: _Capture, now: float) -> float | None:
        """Return the seconds that a capture has left, None if they are not known."""
        if capture.frames is None:
            return None
        passed, share = now - capture.started, capture.share
        seconds, work = sum(self._seconds.values()), sum(self._work.values())
        is_measured = bool(capture.stage) and share >= MIN_SHARE and passed >= MIN_SECONDS
        if is_measured:
            seconds, work = seconds + passed, work + share * _work(capture.stage, capture.frames)
        if work < MIN_WORK_MS:
            return None
        left = 0.0
        for stage in self._stages:
            if stage in capture.ended:
                continue
            pace = self._seconds[stage] / self._work[stage] if self._work[stage] else seconds / work
            whole = pace * _work(stage, capture.frames)
            if stage == capture.stage:
                whole = passed * (1.0 / share - 1.0) if is_measured else max(0.0, whole - passed)
            left += whole
        return left


def _work(stage: str, frames: int) -> float:
    return MS_PER_FRAME.get(stage, 0.0) * frames + MS.get(stage, 0.0 if stage in MS_PER_FRAME else OTHER_MS)


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 1)
