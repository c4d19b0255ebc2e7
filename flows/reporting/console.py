"""Where events are shown: bars on a terminal, plain lines elsewhere, JSON lines for machines."""

import json
import sys
import threading
import time
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict
from typing import IO

from glint.flows.reporting.events import Display, Event, sentence


def open_display(as_json: bool = False) -> Display:
    """The display for where the output goes, to be entered: JSON lines on stdout; bars or plain lines on stderr."""
    if as_json:
        return JsonLines(sys.stdout)
    if not sys.stderr.isatty():
        return PlainLines(sys.stderr)
    from glint.flows.reporting.progress_bars import Bars

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
