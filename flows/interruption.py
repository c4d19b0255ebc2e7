"""Being asked to stop, by SIGINT or SIGTERM: the same as an interrupt at the terminal, and never forgotten.

Some libraries swallow the KeyboardInterrupt that arrives while they are imported; so it is remembered, and raised again
before anything long begins.
"""

import signal
import threading
from types import FrameType

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
    _asked.set()
    raise KeyboardInterrupt
