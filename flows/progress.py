"""What a run says while it runs: bars on a terminal, plain lines elsewhere, JSON lines for machines.

Everything said is an `Event`, which a `Display` shows. A step tells its progress through a callable (done, total), a
`Reporter`. What is told on a Dask worker goes `from_worker` to whoever has begun to `listen`.
"""

import json
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, dataclass
from typing import IO, TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from distributed import Client

TOPIC = "glint-progress"
UNITS = {"survey": "frames", "frames": "frames", "lights": "spheres", "clusters": "tiles"}
"""What a stage counts; other stages count parts of their work."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a capture (OBJECT/CAPTURE) or one of its stages.

    progress: `done` of `total` parts after `seconds`; stage, capture: finished after `seconds`, `frames` long, `cached`
    if nothing was computed; warning, failed, message: `text`.
    """

    kind: Literal["progress", "stage", "capture", "warning", "failed", "message"]
    capture: str = ""
    stage: str = ""
    done: int | None = None
    total: int | None = None
    seconds: float | None = None
    frames: int | None = None
    cached: bool | None = None
    text: str = ""

    @property
    def rate(self) -> float | None:
        """Frames per second, None where frames are not what is counted."""
        counted = self.done if UNITS.get(self.stage) == "frames" and self.kind == "progress" else self.frames
        return counted / self.seconds if counted and self.seconds and not self.cached else None


class Display(AbstractContextManager["Display"], Protocol):
    """Shows events; may be told from any thread."""

    def show(self, event: Event) -> None:
        """Show one event."""


class Reporter:
    """The progress callable of a stage: shows at most so many events a second, and the last one always."""

    def __init__(self, show: Callable[[Event], None], capture: str, stage: str, every: float = 0.2) -> None:
        self._show, self._capture, self._stage, self._every = show, capture, stage, every
        self._begun, self._shown = time.monotonic(), 0.0

    def __call__(self, done: int, total: int | None) -> None:
        """Tell that `done` of `total` parts are done."""
        now = time.monotonic()
        if now - self._shown >= self._every or done == total:
            self._shown = now
            seconds = round(now - self._begun, 3)
            self._show(Event("progress", self._capture, self._stage, done=done, total=total, seconds=seconds))


def from_worker() -> Callable[[Event], None]:
    """How a task on a Dask worker tells of events, asked for in its own thread; they go to whoever listens."""
    from distributed import get_worker

    worker = get_worker()
    return lambda event: worker.log_event(TOPIC, {"event": asdict(event)})


def listen(client: "Client", show: Callable[[Event], None]) -> None:
    """Show what the steps on the workers of this client's cluster tell."""
    client.subscribe_topic(TOPIC, lambda event: show(Event(**event[1]["event"])))


def open_display(as_json: bool = False) -> Display:
    """The display for where the output goes, to be entered: JSON lines on stdout; bars or plain lines on stderr."""
    if as_json:
        return JsonLines(sys.stdout)
    if not sys.stderr.isatty():
        return PlainLines(sys.stderr)
    from flows.bars import Bars

    return Bars()


class JsonLines(AbstractContextManager["Display"]):
    """One JSON object a line for each event, with the time in seconds since 1970; absent keys are not known."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream, self._lock = stream, threading.Lock()

    def show(self, event: Event) -> None:
        """Write the event's line."""
        facts = {name: value for name, value in asdict(event).items() if value not in (None, "")}
        if event.rate is not None:
            facts["frames_per_second"] = round(event.rate, 1)
        with self._lock:
            write_line(self._stream, json.dumps({"time": round(time.time(), 3), **facts}, ensure_ascii=False))

    def __exit__(self, *unused: object) -> None:
        """Nothing to end."""


class PlainLines(AbstractContextManager["Display"]):
    """Readable lines, for logs: of a stage's progress one in `every` seconds."""

    def __init__(self, stream: IO[str], every: float = 5.0) -> None:
        self._stream, self._every, self._lock = stream, every, threading.Lock()
        self._shown: dict[tuple[str, str], float] = {}

    def show(self, event: Event) -> None:
        """Write the event's line."""
        with self._lock:
            if event.kind == "progress":
                now, key = time.monotonic(), (event.capture, event.stage)
                if now - self._shown.setdefault(key, now) < self._every:
                    return
                self._shown[key] = now
            write_line(self._stream, sentence(event))

    def __exit__(self, *unused: object) -> None:
        """Nothing to end."""


def write_line(stream: IO[str], line: str) -> None:
    """Write a line; a reader who has gone away does not stop the run."""
    with suppress(BrokenPipeError):
        stream.write(line + "\n")
        stream.flush()


def sentence(event: Event) -> str:
    """An event in words: `glass/front  frames  1200/8000 frames  950 frames/s`."""
    parts = [part for part in (event.capture, event.stage) if part]
    if event.kind == "progress":
        of_total = f"{event.done}" if event.total is None else f"{event.done}/{event.total}"
        parts.append(f"{of_total} {UNITS.get(event.stage, 'parts')}")
    elif event.kind in ("stage", "capture"):
        parts.append("unchanged" if event.cached else f"done in {event.seconds or 0.0:.1f} s")
    else:
        parts.append(event.text if event.kind == "message" else f"{event.kind}: {event.text}")
    if event.rate is not None:
        parts.append(f"{event.rate:.0f} frames/s")
    return "  ".join(parts)
