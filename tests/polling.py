"""Waiting for what other processes and threads do."""

import time
from collections.abc import Callable
from pathlib import Path

PATIENCE = 120.0
"""Seconds after which a test gives up: a busy machine may need many, and who waits in vain fails in any case."""


def until[Found](look: Callable[[], Found | None], seconds: float = PATIENCE, pause: float = 0.1) -> Found:
    """Repeat a query until its result is true, and return that."""
    deadline = time.monotonic() + seconds
    while not (found := look()):
        assert time.monotonic() < deadline, f"it did not happen: {found!r}"
        time.sleep(pause)
    return found


def has_grown(path: Path, lines: int) -> bool:
    """Return whether a file has more lines than so many."""
    return path.exists() and path.read_text().count("\n") > lines
