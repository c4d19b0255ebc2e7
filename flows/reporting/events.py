"""What a run says while it runs.

Everything said is an `Event`, which a `Display` shows (see `flows.displays`). A step tells its progress through a
callable (done, total), a `Reporter`. What is told on a Dask worker goes `from_worker` to whoever has begun to `listen`.
"""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal, Protocol

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
