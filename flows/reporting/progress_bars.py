"""Progress on a terminal: a bar for each running capture, and a line above for each that has ended."""

import threading
from contextlib import AbstractContextManager

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


class _Clock(ProgressColumn):
    """Time since the capture began; Rich's own clock stands still whenever a stage is complete."""

    def render(self, task: Task) -> Text:
        """Return it as minutes and seconds."""
        minutes, seconds = divmod(int(task.elapsed or 0.0), 60)
        return Text(f"{minutes}:{seconds:02}", style="progress.elapsed")


class ProgressBars(AbstractContextManager["ProgressBars"]):
    """Console sink that draws progress bars."""

    def __init__(self, console: Console | None = None) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            TextColumn("[cyan]{task.fields[stage]}"),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[counted]}"),
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
        self._progress.stop()

    def emit(self, event: Event) -> None:
        """Update the capture's bar, or print a line."""
        with self._lock:
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
            self._bars[event.capture] = self._progress.add_task(name, total=None, stage="", counted="")
        bar = self._bars[event.capture]
        if isinstance(event, StageEnded):
            self._progress.update(bar, stage=event.stage, counted="done")
            return
        total, rate = getattr(event, "total", None), getattr(event, "rate", None)
        left = getattr(event, "seconds_left", None)
        text = counted(event) + ("" if rate is None else f"  {rate:.0f} frames/s") + left_in_words(left)
        done = float(event.done)
        if left is not None:  # the bar is the whole capture's as soon as its length is known
            elapsed = next(task.elapsed or 0.0 for task in self._progress.tasks if task.id == bar)
            done, total = elapsed, elapsed + left
        self._progress.update(bar, completed=done, total=total, stage=event.stage, counted=text)

    def _show_run(self, event: RunProgress) -> None:
        if self._run is None:
            self._run = self._progress.add_task("run", total=event.total, stage="", counted="")
        self._progress.update(self._run, completed=event.done, total=event.total, counted=sentence(event))
