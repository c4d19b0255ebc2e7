"""Show how far the reading of a large input is: its digest comes before any frame is decoded."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from glint.flows.reporting.events import Event, Message
from glint.storage.inputs.digests import READING_PROGRESS

INTERVAL_SECONDS = 5.0
"""Interval of messages about an input; one that is read in less is not mentioned."""


@contextmanager
def reading_shown(emit: Callable[[Event], None]) -> Iterator[None]:
    """Emit a message at intervals while the block reads an input, in this thread or in one with its context."""
    started = dict[str, float]()

    def show(uri: str, done: int, total: int) -> None:
        now = time.monotonic()
        if now - started.setdefault(uri, now) >= INTERVAL_SECONDS:
            started[uri] = now
            emit(Message(f"reading {uri}: {done / 1e9:.1f} of {total / 1e9:.1f} GB"))

    token = READING_PROGRESS.set(show)
    try:
        yield
    finally:
        READING_PROGRESS.reset(token)
