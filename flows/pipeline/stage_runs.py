"""What workers tell of a capture, put into its log and on its progress bar on the dashboard."""

import time
from collections import deque
from contextlib import AbstractContextManager
from typing import Any

from prefect import get_run_logger
from prefect.artifacts import create_progress_artifact, update_progress_artifact

from glint.flows.pipeline.context import Surroundings
from glint.flows.reporting.artifacts import artifact_key
from glint.flows.reporting.events import Event

PROGRESS_SECONDS = 5.0
"""Work that takes longer has its progress on the dashboard, as often as this."""


class Hearing(AbstractContextManager["Hearing"]):
    """Hears of one capture (OBJECT/CAPTURE) while a task run works on it.

    The thread that hears of events must not wait for the server: they are kept until the one that awaits the work
    passes them on. `stage` is the one that was heard of last.
    """

    def __init__(self, here: Surroundings, name: str) -> None:
        self._here, self._name, self._logger = here, name, get_run_logger()
        self._events = deque[Event]()
        self._shown, self._bar = time.monotonic(), None
        self.stage = ""

    def __enter__(self) -> "Hearing":
        """Begin to hear."""
        self._here.listeners[self._name] = self._hear
        return self

    def __exit__(self, kind: type[BaseException] | None, *unused: object) -> None:
        """Log what is left; the bar is full if all went well."""
        self._here.listeners.pop(self._name, None)
        self._logged()
        if kind is None and self._bar is not None:
            update_progress_artifact(self._bar, 100.0, description="done")

    def pass_on(self) -> None:
        """Log the stages that have ended and the warnings; show the last progress on the bar, now and then."""
        latest, now = self._logged(), time.monotonic()
        if latest is None or not latest.total or latest.done is None or now - self._shown < PROGRESS_SECONDS:
            return
        self._shown, percent = now, min(100.0, 100.0 * latest.done / latest.total)
        if self._bar is None:
            key = artifact_key(f"{self._name} progress")
            made: Any = create_progress_artifact(percent, key=key, description=latest.stage)
            self._bar = made
        else:
            update_progress_artifact(self._bar, percent, description=latest.stage)

    def _hear(self, event: Event) -> None:
        self.stage = event.stage or self.stage
        self._events.append(event)

    def _logged(self) -> Event | None:
        """Log what lasts; the progress of a stage that has not ended."""
        latest = None
        while self._events:
            event = self._events.popleft()
            latest = event if event.kind == "progress" else None
            if event.kind == "stage":
                was_there = ", was there already" if event.cached else ""
                self._logger.info("%s in %.2f s%s", event.stage, event.seconds, was_there)
            elif event.kind == "warning":
                self._logger.warning("%s: %s", self._name, event.text)
        return latest
