"""Progress on a terminal: a bar for each running capture, and a line above for each that has ended."""

import threading
from contextlib import AbstractContextManager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from glint.flows.reporting.events import (
    CaptureEnded,
    CaptureFailed,
    Event,
    StageEnded,
    StageProgress,
    StageStarted,
    counted,
    sentence,
)

_STYLES = {"capture": "green", "failed": "bold red", "warning": "yellow"}


class ProgressBars(AbstractContextManager["ProgressBars"]):
    """Console sink that draws progress bars."""

    def __init__(self, console: Console | None = None) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            TextColumn("[cyan]{task.fields[stage]}"),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[counted]}"),
            TimeElapsedColumn(),
            console=console or Console(stderr=True),
            transient=True,
        )
        self._lock = threading.Lock()
        self._bars: dict[str, TaskID] = {}
        self._ended: set[str] = set()

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
            self._progress.update(bar, completed=1, total=1, stage=event.stage, counted="")
            return
        total, rate = getattr(event, "total", None), getattr(event, "rate", None)
        text = counted(event) + ("" if rate is None else f"  {rate:.0f} frames/s")
        self._progress.update(bar, completed=event.done, total=total, stage=event.stage, counted=text)
