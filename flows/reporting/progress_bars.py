"""Progress on a terminal: a bar for each running capture, and a line above for each that has ended."""

import threading
import time
from contextlib import AbstractContextManager, suppress
from dataclasses import replace

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
from rich.text import Text

from glint.flows.reporting.events import (
    CaptureEnded,
    CaptureFailed,
    Event,
    RunProgress,
    StageEnded,
    StageProgress,
    StageStarted,
    counted,
    left_in_words,
    sentence,
)

_STYLES = {"capture": "green", "failed": "bold red", "warning": "yellow"}
MIN_LEFT_SECONDS = 1.0
"""Time left that is shown at least: what is in progress has not ended."""


class _Clock(ProgressColumn):
    """Time since the capture began; Rich's own clock stops whenever a stage is complete."""

    def render(self, task: Task) -> Text:
        """Return it as minutes and seconds."""
        minutes, seconds = divmod(int(task.elapsed or 0.0), 60)
        return Text(f"{minutes}:{seconds:02}", style="progress.elapsed")


class _Counted(ProgressColumn):
    """Progress and time left; the time counts down between events too."""

    def render(self, task: Task) -> Text:
        """Return both in words."""
        end = task.fields["end"]
        left = None if end is None else max(MIN_LEFT_SECONDS, end - time.monotonic())
        return Text(task.fields["counted"] + left_in_words(left))


class ProgressBars(AbstractContextManager["ProgressBars"]):
    """Console sink that draws progress bars."""

    def __init__(self, console: Console | None = None) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            TextColumn("[cyan]{task.fields[stage]}"),
            BarColumn(bar_width=30),
            _Counted(),
            _Clock(),
            console=console or Console(stderr=True),
            transient=True,
        )
        self._lock = threading.Lock()
        self._bars: dict[str, TaskID] = {}
        self._ended: set[str] = set()
        self._run: TaskID | None = None

    def __enter__(self) -> "ProgressBars":
        """Start to draw."""
        self._progress.start()
        return self

    def __exit__(self, *unused: object) -> None:
        """Remove the bars and keep the lines."""
        with suppress(OSError):
            self._progress.stop()

    def emit(self, event: Event) -> None:
        """Update the capture's bar, or print a line; a run goes on where its terminal is gone."""
        with self._lock, suppress(OSError):
            if isinstance(event, StageStarted | StageProgress | StageEnded):
                if event.capture not in self._ended:
                    self._update(event)
                return
            if isinstance(event, RunProgress):
                self._show_run(event)
                return
            if isinstance(event, CaptureEnded | CaptureFailed):
                self._ended.add(event.capture)
                if event.capture in self._bars:
                    self._progress.remove_task(self._bars.pop(event.capture))
            self._progress.print(escape(sentence(event)), style=_STYLES.get(event.kind), highlight=False)

    def _update(self, event: StageStarted | StageProgress | StageEnded) -> None:
        if event.capture not in self._bars:
            name = escape(event.capture)
            self._bars[event.capture] = self._progress.add_task(name, total=None, stage="", counted="", end=None)
        bar = self._bars[event.capture]
        if isinstance(event, StageEnded):
            self._progress.update(bar, stage=event.stage, counted="done")
            return
        rate = getattr(event, "rate", None)
        text = counted(event) + ("" if rate is None else f"  {rate:.0f} frames/s")
        self._progress.update(bar, stage=event.stage, counted=text)
        if isinstance(event, StageProgress) and event.share is not None:  # earlier, the bar only pulses
            self._progress.update(bar, completed=event.share, total=1.0, end=_end_of(event))

    def _show_run(self, event: RunProgress) -> None:
        if self._run is None:
            self._run = self._progress.add_task("run", total=event.total, stage="", counted="", end=None)
        text = sentence(replace(event, seconds_left=None))
        self._progress.update(self._run, completed=event.done, total=event.total, counted=text, end=_end_of(event))


def _end_of(event: StageProgress | RunProgress) -> float | None:
    """Return when what an event is about will end, on the monotonic clock; None: not known."""
    return None if event.seconds_left is None else time.monotonic() + event.seconds_left
