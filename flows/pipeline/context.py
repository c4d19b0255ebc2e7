"""What flows of this process share: the Dask client, and who is told of progress.

Flow parameters are JSON and name the scheduler alone; by its address a flow finds both here. Where a worker of Prefect
runs the flow nothing was put here before, and a client is opened.
"""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass, field

from distributed import Client

from glint.flows.reporting.events import Event, Reporter, listen


def _nobody(event: Event) -> None:
    """No one is told."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """client: for all threads of this process; show: told of every event, and `listeners` of those of their capture;
    turns: captures worked on at once, `working` those that are; ended: whether the run has been abandoned."""

    client: Client
    show: Callable[[Event], None] = _nobody
    turns: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(2))
    ended: threading.Event = field(default_factory=threading.Event)
    listeners: dict[str, Callable[[Event], None]] = field(default_factory=dict)
    working: set[str] = field(default_factory=set)

    def abandon(self) -> None:
        """End the run: what waits for a worker fails at once, and nothing more is begun."""
        self.ended.set()
        self.client.close()

    def check(self) -> None:
        """Go on only if the run has not been abandoned.

        Raises:
            CancelledError: it has.
        """
        if self.ended.is_set():
            raise CancelledError("the run was interrupted")

    @contextmanager
    def turn(self, capture: str) -> Iterator[None]:
        """Wait for this capture's turn, and take it.

        Raises:
            CancelledError: the run was abandoned meanwhile.
        """
        with self.turns:
            self.check()
            self.working.add(capture)
            try:
                yield
            finally:
                self.working.discard(capture)

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Tell what fails because the run has been abandoned as just that.

        Raises:
            CancelledError: it has been.
        """
        try:
            yield
        except Exception:
            self.check()
            raise

    def reporter(self, capture: str, stage: str) -> Reporter:
        """The progress callable of a stage that is performed in this process."""
        return Reporter(self.show, capture, stage)


def side_by_side(workers: int) -> int:
    """Captures to work on at once: one more than workers keeps them busy while another is between stages."""
    return workers + 1


_known: dict[str, Surroundings] = {}
_lock = threading.Lock()


def share(address: str, client: Client, display: object | None = None) -> None:
    """Let flows that name this scheduler use this client, and tell this display (see `progress.Display`)."""
    told: Callable[[Event], None] = getattr(display, "show", _nobody)
    turns = threading.Semaphore(side_by_side(len(client.nthreads())))
    listeners: dict[str, Callable[[Event], None]] = {}

    def show(event: Event) -> None:
        listeners.get(event.capture, _nobody)(event)
        told(event)

    listen(client, show)
    _known[address] = Surroundings(client, show, turns, listeners=listeners)


def surroundings(address: str) -> Surroundings:
    """What was shared for this scheduler, else a new client of it."""
    with _lock:
        if address not in _known:
            share(address, Client(address, set_as_default=False))
        return _known[address]
