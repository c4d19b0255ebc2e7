"""Events of a run: small records of progress, ends, warnings and failures, and the sinks that receive them.

The age of an event of a stage is the time, in seconds, that it has waited on its worker.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from glint.storage.errors import printable


@dataclass(frozen=True, slots=True)
class StageStarted:
    """A stage of a capture (OBJECT/CAPTURE) has begun; consoles show it as progress with nothing done."""

    kind: ClassVar[str] = "progress"
    capture: str
    stage: str
    unit: str = "parts"
    done: int = 0
    seconds: float = 0.0
    age: float = field(default=0.0, compare=False)


@dataclass(frozen=True, slots=True)
class StageProgress:
    """`done` of `total` units (None: unknown) of a stage are done after `seconds`.

    seconds_left: until the capture ends; share: the part of the capture's time that has passed, below 1; both None as
    long as they are not known.
    """

    kind: ClassVar[str] = "progress"
    capture: str
    stage: str
    done: int
    total: int | None = None
    seconds: float = 0.0
    unit: str = "parts"
    seconds_left: float | None = None
    share: float | None = None
    age: float = field(default=0.0, compare=False)

    @property
    def rate(self) -> float | None:
        """Frames per second, None if another unit is counted."""
        return _rate(self.done if self.unit == "frames" else None, self.seconds)


@dataclass(frozen=True, slots=True)
class StageEnded:
    """A stage has ended after `seconds`; cached: its result was stored already; frames: length of the video."""

    kind: ClassVar[str] = "stage"
    capture: str
    stage: str
    seconds: float
    cached: bool = False
    frames: int | None = None
    age: float = field(default=0.0, compare=False)

    @property
    def rate(self) -> float | None:
        """Frames per second, None if nothing was computed or the stage has no frames."""
        return None if self.cached else _rate(self.frames, self.seconds)


@dataclass(frozen=True, slots=True)
class CaptureEnded:
    """A capture, or the model of an object, has a result; cached: nothing was computed, None: unknown."""

    kind: ClassVar[str] = "capture"
    capture: str
    seconds: float
    cached: bool | None = None


@dataclass(frozen=True, slots=True)
class CaptureFailed:
    """A capture has no result; text: the error and its remedy."""

    kind: ClassVar[str] = "failed"
    capture: str
    text: str


@dataclass(frozen=True, slots=True)
class CaptureWarning:
    """A warning about a capture, from one of its stages or (stage empty) from a comparison with its last version."""

    kind: ClassVar[str] = "warning"
    capture: str
    text: str
    stage: str = ""
    age: float = field(default=0.0, compare=False)


@dataclass(frozen=True, slots=True)
class RunProgress:
    """`done` of a run's captures have ended; seconds_left: until all have, None as long as it is not known."""

    kind: ClassVar[str] = "run"
    done: int
    total: int
    seconds_left: float | None = None
    capture: str = ""


@dataclass(frozen=True, slots=True)
class Message:
    """Anything else that is reported, about a capture or the whole run."""

    kind: ClassVar[str] = "message"
    text: str
    capture: str = ""


type StageEvent = StageStarted | StageProgress | StageEnded | CaptureWarning
"""Events of workers."""
type Event = StageEvent | CaptureEnded | CaptureFailed | RunProgress | Message


class Sink(Protocol):
    """Receives every event of a run, from any thread; it must not block."""

    def emit(self, event: Event) -> None:
        """Handle one event."""


class ProgressThrottle:
    """The progress callable of a stage: emits at most one event per `interval` seconds, and always the last one."""

    def __init__(
        self, emit: Callable[[StageEvent], None], capture: str, stage: str, unit: str = "parts", interval: float = 0.2
    ) -> None:
        self._emit, self._capture, self._stage, self._unit = emit, capture, stage, unit
        self._interval, self._started, self._emitted = interval, time.monotonic(), 0.0

    def __call__(self, done: int, total: int | None) -> None:
        """Report that `done` of `total` units are done."""
        now = time.monotonic()
        if now - self._emitted >= self._interval or done == total:
            self._emitted = now
            seconds = round(now - self._started, 3)
            self._emit(StageProgress(self._capture, self._stage, done, total, seconds, self._unit))


def sentence(event: Event) -> str:
    """Return an event in words: `glass/front  frames  1200/8000 frames  950 frames/s`."""
    parts = [event.capture, getattr(event, "stage", "")]
    match event:
        case StageStarted() | StageProgress():
            parts.append(counted(event))
        case StageEnded() | CaptureEnded():
            parts.append("up to date" if event.cached else f"done in {event.seconds:.1f} s")
        case RunProgress():
            parts.append(f"{event.done} of {event.total} captures")
        case Message():
            parts.append(event.text)
        case _:
            parts.append(f"{event.kind}: {event.text}")
    rate = getattr(event, "rate", None)
    if rate is not None:
        parts.append(f"{rate:.0f} frames/s")
    text = "  ".join(part for part in parts if part)
    return printable(text + left_in_words(getattr(event, "seconds_left", None)))


def left_in_words(seconds: float | None) -> str:
    """Return `, about 40 s left`, in round numbers; empty if it is not known or less than a second."""
    if seconds is None or seconds < 1.0:
        return ""
    for unit, unit_s in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * unit_s:
            count = seconds / unit_s
            return f", about {count:.{int(unit == 'h')}f} {unit} left"
    step = 1.0 if seconds < 10.0 else 5.0
    return f", about {step * round(seconds / step):.0f} s left"


def counted(event: StageStarted | StageProgress) -> str:
    """Return progress in words: `3/9 tiles`."""
    total = getattr(event, "total", None)
    return f"{event.done} {event.unit}" if total is None else f"{event.done}/{total} {event.unit}"


def _rate(frames: int | None, seconds: float) -> float | None:
    return frames / seconds if frames and seconds else None
