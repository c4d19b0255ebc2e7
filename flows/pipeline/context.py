"""The run context: what all flows and tasks of a run share in this process.

It is set where a run begins (`activate`), and found by everything that the run calls. A thread must be started with a
copy of the caller's context variables; without one `run_context` raises LookupError.
"""

import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field

from distributed import Client

from glint.flows.pipeline.prefect_sink import PrefectSink
from glint.flows.reporting.events import Event, Sink
from glint.flows.reporting.input_reading import reading_shown
from glint.flows.reporting.time_left import TimeLeft
from glint.flows.reporting.worker_events import TOPIC, subscribe
from glint.flows.results import ObjectResult
from glint.tasks.pipeline import NAMES


@dataclass(frozen=True, slots=True)
class RunContext:
    """The shared state of a run.

    client: Dask client for all threads of this process. prefect: shows events on the dashboard. sinks: receive every
    event besides. max_captures: captures processed at the same time, limited by the semaphore `slots`. active: names of
    the captures in progress. unchanged: results of objects that need no processing, as far as they are known.
    time_left: how long captures and run still take. cancelled: set when the run is cancelled.
    """

    client: Client
    prefect: PrefectSink
    sinks: tuple[Sink, ...] = ()
    max_captures: int = 2
    unchanged: Mapping[str, ObjectResult] = field(default_factory=dict)
    slots: threading.Semaphore = field(init=False)
    active: set[str] = field(default_factory=set)
    time_left: TimeLeft = field(default_factory=lambda: TimeLeft(NAMES))
    cancelled: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        """Make the semaphore of `max_captures`."""
        object.__setattr__(self, "slots", threading.Semaphore(self.max_captures))

    def emit(self, event: Event) -> None:
        """Pass an event to all sinks."""
        for shown in self.time_left.follow(event):
            self.prefect.emit(shown)
            for sink in self.sinks:
                sink.emit(shown)

    def cancel(self) -> None:
        """Cancel the run: waiting for a worker fails at once, and no further capture begins."""
        self.cancelled.set()
        self.client.close()

    def raise_if_cancelled(self) -> None:
        """Return unless the run was cancelled.

        Raises:
            CancelledError: it was.
        """
        if self.cancelled.is_set():
            raise CancelledError("the run was interrupted")

    @contextmanager
    def slot(self, capture: str) -> Iterator[None]:
        """Wait until fewer than `max_captures` captures are in progress, and count this one among them.

        Raises:
            CancelledError: the run was cancelled in the meantime.
        """
        with self.slots:
            self.raise_if_cancelled()
            self.active.add(capture)
            try:
                yield
            finally:
                self.active.discard(capture)

    @contextmanager
    def cancellable(self) -> Iterator[None]:
        """Replace errors that a cancelled run causes, such as a closed client, by CancelledError.

        Raises:
            CancelledError: the body failed and the run was cancelled.
        """
        try:
            yield
        except Exception:
            self.raise_if_cancelled()
            raise


_CURRENT: ContextVar[RunContext] = ContextVar("glint_run_context")


def run_context() -> RunContext:
    """Return the context of the current run.

    Raises:
        LookupError: no run is active in this thread.
    """
    return _CURRENT.get()


@contextmanager
def activate(client: Client, *sinks: Sink, unchanged: Mapping[str, ObjectResult] | None = None) -> Iterator[RunContext]:
    """Make a run context current: its flows use this client and report to these sinks and to Prefect.

    unchanged: results of objects that are known to need no processing; they have been reported.
    """
    # One capture more than workers keeps them busy while another capture is between two tasks.
    max_captures = len(client.nthreads()) + 1
    with PrefectSink() as prefect:
        context = RunContext(client, prefect, sinks, max_captures, unchanged or {})
        subscribe(client, context.emit)
        token = _CURRENT.set(context)
        try:
            with reading_shown(context.emit):
                yield context
        finally:
            _CURRENT.reset(token)
            with suppress(Exception):  # a cancelled run has closed its client
                client.unsubscribe_topic(TOPIC)
