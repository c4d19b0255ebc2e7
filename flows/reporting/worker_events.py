"""The way of events from Dask workers to the sinks of a run.

Stages that run on a worker publish their events to the scheduler, those of half a second in one message; the flow's
process subscribes to them and passes each to the sinks of its run.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from glint.flows.reporting.events import CaptureWarning, Event, StageEnded, StageEvent, StageProgress, StageStarted

if TYPE_CHECKING:
    from distributed import Client

TOPIC = "glint-progress"
"""Dask topic of the workers' events."""
PUBLISH_SECONDS = 0.5
"""Time for which a worker keeps an event, so that one message carries several: each costs the flow's process a
millisecond of processor time, and a short capture has thirty events."""

_TYPES: dict[str, type[StageEvent]] = {
    event_type.__name__: event_type for event_type in (StageStarted, StageProgress, StageEnded, CaptureWarning)
}


class WorkerEvents(AbstractContextManager["WorkerEvents"]):
    """Publishes the events of a task on a Dask worker; to be made in the task's thread.

    An event waits PUBLISH_SECONDS for others to go with it. A context manager that publishes what waits at its end, so
    that it arrives before the task's result.
    """

    def __init__(self) -> None:
        from distributed import get_worker

        self._worker, self._lock = get_worker(), threading.Lock()
        self._waiting: list[tuple[float, StageEvent]] = []

    def __exit__(self, *unused: object) -> None:
        """Publish the events that wait."""
        self._publish()

    def emit(self, event: StageEvent) -> None:
        """Publish an event, at most PUBLISH_SECONDS later."""
        with self._lock:
            self._waiting.append((time.monotonic(), event))
            is_first = len(self._waiting) == 1
        if is_first:
            loop = self._worker.loop
            loop.add_callback(loop.call_later, PUBLISH_SECONDS, self._publish)

    def _publish(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
            now = time.monotonic()
            message = [
                {"type": type(event).__name__, "event": asdict(event) | {"age": round(now - moment, 3)}}
                for moment, event in waiting
            ]
            if message:
                self._worker.log_event(TOPIC, message)


def subscribe(client: "Client", emit: Callable[[Event], None]) -> None:
    """Pass on the events that workers of this client's cluster publish; a later subscription replaces an earlier."""

    def receive(entry: tuple[float, Sequence[Mapping[str, Any]]]) -> None:
        for message in entry[1]:
            emit(_TYPES[message["type"]](**message["event"]))

    client.subscribe_topic(TOPIC, receive)
