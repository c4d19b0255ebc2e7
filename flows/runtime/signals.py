"""Handle SIGINT and SIGTERM: raise KeyboardInterrupt, and remember the request in case a library swallows it.

Some libraries swallow a KeyboardInterrupt that arrives while they are imported, so `raise_if_interrupted` raises it
again before anything long begins. A run that does not end in time is ended: a cluster that is interrupted during its
start may otherwise wait forever for workers.
"""

import os
import signal
import threading
from types import FrameType

EXIT_STATUS = 130
"""Exit status of an interrupted run that did not end by itself."""
GRACE_SECONDS = 30.0
"""How long an interrupted run may take to end."""

_interrupted = threading.Event()


def install() -> None:
    """Install the handler of both signals; to be called in the main thread."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)


def raise_if_interrupted() -> None:
    """Return unless the process was interrupted.

    Raises:
        KeyboardInterrupt: it was.
    """
    if _interrupted.is_set():
        raise KeyboardInterrupt


def _handle(number: int, frame: FrameType | None) -> None:
    if not _interrupted.is_set():
        _interrupted.set()
        timer = threading.Timer(GRACE_SECONDS, os._exit, [EXIT_STATUS])
        timer.daemon = True
        timer.start()
    raise KeyboardInterrupt
