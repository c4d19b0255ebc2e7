"""Progress on a terminal: a bar for each capture that runs, a line above for each that has ended."""

import threading
from contextlib import AbstractContextManager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from glint.flows.reporting.events import UNITS, Event, sentence

_STYLES = {"capture": "green", "failed": "bold red", "warning": "yellow"}


class Bars(AbstractContextManager["Bars"]):
    """Shows events as bars."""

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

    def __enter__(self) -> "Bars":
        """Start to draw."""
        self._progress.start()
        return self

    def __exit__(self, *unused: object) -> None:
        """Leave the lines, remove the bars."""
        self._progress.stop()

    def show(self, event: Event) -> None:
        """Move the capture's bar; print what lasts."""
        with self._lock:
            if event.kind in ("progress", "stage"):
                if event.capture not in self._ended:
                    self._move(event)
                return
            if event.kind in ("capture", "failed"):
                self._ended.add(event.capture)
                if event.capture in self._bars:
                    self._progress.remove_task(self._bars.pop(event.capture))
            self._progress.print(escape(sentence(event)), style=_STYLES.get(event.kind), highlight=False)

    def _move(self, event: Event) -> None:
        if event.capture not in self._bars:
            name = escape(event.capture)
            self._bars[event.capture] = self._progress.add_task(name, total=None, stage="", counted="")
        bar = self._bars[event.capture]
        if event.kind == "stage":
            self._progress.update(bar, completed=1, total=1, stage=event.stage, counted="")
            return
        rate = "" if event.rate is None else f"  {event.rate:.0f} frames/s"
        total = "" if event.total is None else f"/{event.total}"
        counted = f"{event.done}{total} {UNITS.get(event.stage, 'parts')}{rate}"
        self._progress.update(bar, completed=event.done, total=event.total, stage=event.stage, counted=counted)
