"""Being asked to stop, by SIGINT or SIGTERM: the same as an interrupt at the terminal, and never forgotten.

Some libraries swallow the KeyboardInterrupt that arrives while they are imported; so it is remembered, and raised again
before anything long begins. A run that has not ended by itself in time is ended: a cluster that is interrupted while it
starts may wait for ever for workers that will not come.
"""

import os
import signal
import threading
from types import FrameType

ENDED = 130
"""Exit status of a run that was asked to stop."""
GRACE_SECONDS = 30.0
"""How long a run that was asked to stop may take to end."""

_asked = threading.Event()


def install() -> None:
    """Take both signals, in the main thread."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _take)


def check() -> None:
    """Go on only if nobody has asked to stop.

    Raises:
        KeyboardInterrupt: somebody has.
    """
    if _asked.is_set():
        raise KeyboardInterrupt


def _take(number: int, frame: FrameType | None) -> None:
    if not _asked.is_set():
        _asked.set()
        last = threading.Timer(GRACE_SECONDS, os._exit, [ENDED])
        last.daemon = True
        last.start()
    raise KeyboardInterrupt
