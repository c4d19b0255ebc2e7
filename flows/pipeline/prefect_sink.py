"""The sink that shows captures on Prefect's dashboard: stage runs on the timeline, warnings, progress."""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager
from contextvars import copy_context
from datetime import UTC, datetime, timedelta
from typing import Any

from prefect import get_run_logger
from prefect.artifacts import create_progress_artifact, update_progress_artifact
from prefect.client.schemas.objects import TaskRun
from prefect.context import TaskRunContext

from glint.flows.errors import message_and_remedy
from glint.flows.pipeline.stage_runs import StageRun
from glint.flows.reporting.artifacts import artifact_key
from glint.flows.reporting.events import (
    CaptureWarning,
    Event,
    StageEnded,
    StageProgress,
    StageStarted,
    left_in_words,
)

RUNNING_SECONDS = 1.0
"""A stage that takes longer is shown while it runs; a shorter one appears when it has ended, at half the cost."""
ARTIFACT_SECONDS = 5.0
"""Interval of progress updates on the dashboard; work that takes less has none."""
CLOSE_SECONDS = 10.0
"""Time for which the end of a capture or of a run waits for the last events to be handled."""


class TaskRunReporter:
    """Reports one capture's events in the task run that was current when it was made.

    `stage` is the stage reported last. The other methods belong to the sink's thread.
    """

    def __init__(self, capture: str, parent: TaskRun) -> None:
        self.stage = ""
        self._capture, self._parent = capture, parent
        self._context, self._logger = copy_context(), get_run_logger()
        self._stage_run: StageRun | None = None
        self._is_announced = False
        self._bar: Any = None
        self._updated = time.monotonic()

    def attempt(self, action: Callable[[], None]) -> None:
        """Run an action of this reporter; a server that is unreachable for a while must not stop the run."""
        try:
            action()
        except Exception:
            self._logger.debug("the dashboard was not updated", exc_info=True)

    @property
    def seconds_to_announce(self) -> float | None:
        """Seconds until the current stage is to be shown as running; None if it is, or none has begun."""
        if self._stage_run is None or self._is_announced:
            return None
        return max(0.0, RUNNING_SECONDS - (_now() - self._stage_run.started).total_seconds())

    def announce_running(self) -> None:
        """Show the current stage as running."""
        if self._stage_run is not None and not self._is_announced:
            self._is_announced = True
            self._context.run(self._stage_run.announce_running)

    def handle(self, event: Event, moment: datetime) -> None:
        """Report an event; moment: when it happened on its worker."""
        match event:
            case StageStarted():
                if self._stage_run is not None:
                    # Dask gives the task of a dead worker to the next one, which begins anew.
                    message = "The worker process died; the stage is run again."
                    self._context.run(self._stage_run.announce_crashed, moment, message)
                self._begin(event.stage, moment)
            case StageEnded():
                if self._stage_run is None or self._stage_run.stage != event.stage:
                    self._begin(event.stage, moment - timedelta(seconds=event.seconds))
                assert self._stage_run is not None
                self._context.run(self._stage_run.announce_completed, moment, event.cached)
                self._stage_run = None
            case CaptureWarning():
                self._context.run(self._logger.warning, "%s: %s", self._capture, event.text)
            case StageProgress():
                self._update_bar(event)

    def finish(self, error: BaseException | None, moment: datetime) -> None:
        """End the current stage as the task run ends, and fill the bar if all went well."""
        if self._stage_run is not None:
            if error is None:
                self._context.run(self._stage_run.announce_completed, moment)
            elif isinstance(error, Exception) and not isinstance(error, CancelledError):
                self._context.run(self._stage_run.announce_failed, moment, ": ".join(message_and_remedy(error)))
            else:
                self._context.run(self._stage_run.announce_crashed, moment, "The run was interrupted.")
            self._stage_run = None
        if error is None and self._bar is not None:
            self._context.run(update_progress_artifact, self._bar, 100.0, description="done")

    def _begin(self, stage: str, started: datetime) -> None:
        self._stage_run, self._is_announced = StageRun(self._parent, stage, started), False

    def _update_bar(self, event: StageProgress) -> None:
        now = time.monotonic()
        if not event.total or now - self._updated < ARTIFACT_SECONDS:
            return
        # The bar is the capture's: one of a stage would be full again and again.
        self._updated, percent = now, 100.0 * (event.share or 0.0)
        text = event.stage + left_in_words(event.seconds_left)
        if self._bar is None:
            key = artifact_key(f"{self._capture} progress")
            self._bar = self._context.run(create_progress_artifact, percent, key=key, description=text)
        else:
            self._context.run(update_progress_artifact, self._bar, percent, description=text)


class PrefectSink(AbstractContextManager["PrefectSink"]):
    """Reports the events of attached captures on the dashboard.

    Events arrive on Dask's I/O thread, which must not block on HTTP: they are queued, and one thread handles them in
    order. A context manager that handles what is left before it ends.
    """

    def __init__(self) -> None:
        self._reporters: dict[str, TaskRunReporter] = {}
        self._queue = queue.SimpleQueue[tuple[TaskRunReporter, Callable[[], None]] | None]()
        self._thread = threading.Thread(target=self._work, name="glint-prefect-sink", daemon=True)

    def __enter__(self) -> "PrefectSink":
        """Start the thread."""
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        """Wait for the thread to handle what is queued."""
        self._queue.put(None)
        self._thread.join(CLOSE_SECONDS)

    def emit(self, event: Event) -> None:
        """Queue an event if its capture is attached."""
        reporter = self._reporters.get(event.capture)
        if reporter is not None:
            reporter.stage = getattr(event, "stage", "") or reporter.stage
            moment = _now() - timedelta(seconds=getattr(event, "age", 0.0))
            self._queue.put((reporter, lambda: reporter.handle(event, moment)))

    @contextmanager
    def attach(self, capture: str) -> Iterator[TaskRunReporter]:
        """Report the events of a capture (OBJECT/CAPTURE) in the current task run, while the body runs."""
        run = TaskRunContext.get()
        assert run is not None, "stages are shown inside the task run of their capture"
        reporter = self._reporters[capture] = TaskRunReporter(capture, run.task_run)
        failure: BaseException | None = None
        try:
            yield reporter
        except BaseException as error:
            failure = error
            raise
        finally:
            self._reporters.pop(capture, None)
            self._finish(reporter, failure)

    def _finish(self, reporter: TaskRunReporter, failure: BaseException | None) -> None:
        """Have a reporter finished, and wait for it: its client is the task run's, which closes it at its end."""
        moment, handled = _now(), threading.Event()

        def finish() -> None:
            try:
                reporter.finish(failure, moment)
            finally:
                handled.set()

        self._queue.put((reporter, finish))
        if self._thread.is_alive():
            handled.wait(CLOSE_SECONDS)

    def _work(self) -> None:
        waiting = set[TaskRunReporter]()
        while True:
            due = [seconds for reporter in waiting if (seconds := reporter.seconds_to_announce) is not None]
            try:
                item = self._queue.get(timeout=min(due, default=None))
            except queue.Empty:
                for reporter in waiting:
                    if reporter.seconds_to_announce == 0.0:
                        reporter.attempt(reporter.announce_running)
                continue
            if item is None:
                return
            reporter, action = item
            reporter.attempt(action)
            (waiting.discard if reporter.seconds_to_announce is None else waiting.add)(reporter)


def _now() -> datetime:
    return datetime.now(UTC)
