"""Handle SIGINT and SIGTERM: one line, KeyboardInterrupt, and an end in time.

Some libraries swallow a KeyboardInterrupt that arrives while they are imported, so `raise_if_interrupted` raises it
again before anything long begins; others print a traceback where one arrives in a callback, so these are left out. A
run that does not end in time, or is asked twice, is ended.
"""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

EXIT_STATUS = 130
"""Exit status of an interrupted run that did not end by itself."""
GRACE_SECONDS = 30.0
"""Time that an interrupted run may take to end."""
REPEAT_SECONDS = 1.0
"""A second signal ends the run at once, unless it comes so soon that a terminal and its shell sent the same one."""
LINE = "glint: interrupted; what is finished is kept, and the same command goes on from there"

_line = LINE
_interrupted = threading.Event()
_repeated = threading.Event()


def install() -> None:
    """Install the handler of both signals; to be called in the main thread."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)
    sys.excepthook = _without_interrupts(sys.excepthook)
    sys.unraisablehook = _without_interrupts(sys.unraisablehook)
    threading.excepthook = _without_interrupts(threading.excepthook)


def describe_end(line: str) -> None:
    """Set what is printed when this process is interrupted: not every command goes on where it stopped."""
    global _line
    _line = line


def was_interrupted() -> bool:
    """Return whether one of the signals has come."""
    return _interrupted.is_set()


def raise_if_interrupted() -> None:
    """Return unless the process was interrupted.

    Raises:
        KeyboardInterrupt: it was.
    """
    if _interrupted.is_set():
        raise KeyboardInterrupt


def _handle(number: int, frame: FrameType | None) -> None:
    if _repeated.is_set():
        os._exit(EXIT_STATUS)
    if not _interrupted.is_set():
        _interrupted.set()
        # The terminal, or the reader of a pipe, may be gone; the run must end nevertheless.
        with suppress(OSError):
            # Unbuffered and without a lock, which the interrupted code may hold.
            os.write(2, f"{_line}\n".encode())
        # Where the interrupt comes between a coroutine's call and its await, Python would warn of it at the end.
        warnings.filterwarnings("ignore", r"coroutine .* was never awaited", RuntimeWarning)
        for seconds, call, arguments in ((REPEAT_SECONDS, _repeated.set, []), (GRACE_SECONDS, os._exit, [EXIT_STATUS])):
            timer = threading.Timer(seconds, call, arguments)
            timer.daemon = True
            timer.start()
    raise KeyboardInterrupt


def _without_interrupts(hook: Callable[..., Any]) -> Callable[..., Any]:
    """Return a hook of exceptions that leaves out those of an interrupt."""

    def call(*arguments: Any) -> None:
        kinds = [arguments[0]] if isinstance(arguments[0], type) else [arguments[0].exc_type]
        if not (_interrupted.is_set() and issubclass(kinds[0], KeyboardInterrupt)):
            hook(*arguments)

    return call
