"""Console sinks: progress bars on a terminal, plain lines elsewhere, JSON lines for machines."""

import json
import sys
import threading
import time
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict
from typing import IO, Protocol, Self

from glint.flows.reporting.events import Event, RunProgress, Sink, StageProgress, StageStarted, sentence
from glint.storage.errors import printable


class ConsoleSink(Sink, Protocol):
    """A sink that writes to the console while it is entered."""

    def __enter__(self) -> Self:
        """Begin to write."""

    def __exit__(self, *unused: object) -> None:
        """Leave the console as it was."""


def open_console(as_json: bool = False) -> ConsoleSink:
    """Return the sink that fits the output: JSON lines on stdout; progress bars or plain lines on stderr."""
    if as_json:
        return JsonLines(sys.stdout)
    if not sys.stderr.isatty():
        return PlainLines(sys.stderr)
    from glint.flows.reporting.progress_bars import ProgressBars

    return ProgressBars()


class JsonLines(AbstractContextManager["JsonLines"]):
    """One JSON object per line for each event, with the time in seconds since 1970; unknown keys are absent."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream, self._lock = stream, threading.Lock()

    def emit(self, event: Event) -> None:
        """Write the event's line."""
        fields = {name: value for name, value in asdict(event).items() if value not in (None, "")}
        age = fields.pop("age", 0.0)
        fields.pop("unit", None)
        rate = getattr(event, "rate", None)
        if rate is not None:
            fields["frames_per_second"] = round(rate, 1)
        line = {"time": round(time.time() - age, 3), "kind": event.kind, **fields}
        with self._lock:
            write_line(self._stream, printable(json.dumps(line, ensure_ascii=False)))

    def __exit__(self, *unused: object) -> None:
        """Leave the stream open."""


class PlainLines(AbstractContextManager["PlainLines"]):
    """Readable lines for logs; of a stage's progress at most one line per `interval` seconds."""

    def __init__(self, stream: IO[str], interval: float = 5.0) -> None:
        self._stream, self._interval, self._lock = stream, interval, threading.Lock()
        self._written: dict[tuple[str, str], float] = {}

    def emit(self, event: Event) -> None:
        """Write the event's line."""
        with self._lock:
            if isinstance(event, StageStarted | StageProgress | RunProgress):
                now, key = time.monotonic(), (event.capture, getattr(event, "stage", ""))
                if now - self._written.setdefault(key, now) < self._interval:
                    return
                self._written[key] = now
            write_line(self._stream, sentence(event))

    def __exit__(self, *unused: object) -> None:
        """Leave the stream open."""


def write_line(stream: IO[str], line: str) -> None:
    """Write a line; a closed pipe, a full disk or a terminal that is gone does not stop the run."""
    with suppress(OSError):
        stream.write(line + "\n")
        stream.flush()
