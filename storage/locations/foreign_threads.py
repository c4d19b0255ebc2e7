"""Threads that Python did not start, which must have left it before the interpreter ends."""

import sys
import threading
import time

LONGEST_WAIT = 1.0
"""Seconds that the end of a process is put off at most: the call that is waited for takes less than a millisecond."""
PAUSE = 0.001
"""Seconds between two looks."""


def await_foreign_threads(longest_wait: float = LONGEST_WAIT) -> None:
    """Wait until no thread that Python did not start runs Python code, at most longest_wait seconds.

    Icechunk's threads hand their results over to Python, and a reader may have its result and come to its end while
    they are still in that call. The end of the interpreter would then tear such a thread out of its library, and the
    process, whose work is done, ends with a segmentation fault.
    """
    latest = time.monotonic() + longest_wait
    while _foreign_threads() and time.monotonic() < latest:
        time.sleep(PAUSE)


def _foreign_threads() -> set[int]:
    """Return the identifiers of the threads that run Python code and are none of Python's own."""
    return set(sys._current_frames()) - {thread.ident for thread in threading.enumerate() if thread.ident is not None}
