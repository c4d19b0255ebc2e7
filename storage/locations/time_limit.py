"""Calls that read inputs, with a time limit: a network mount whose server is gone blocks them forever."""

import contextvars
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import cast

from glint.storage.errors import InputError

SILENCE_SECONDS = 60.0
"""Time for which an input may give nothing: a tape or a sleeping disk answers within half of it."""
MAX_READY = 2
"""Items that are made before they are taken: frames, each as large as a picture."""
_STOP_SECONDS = 0.05
"""Interval at which the end of a thread is awaited that has been stopped."""


def within_time[Result](function: Callable[[Callable[[], None]], Result], uri: str) -> Result:
    """Return the result of a function that reads `uri`; it is called with a function to call after every step.

    The function runs in a thread, which is left behind if it hangs: nothing ends a read of a dead mount.

    Raises:
        InputError: no step has ended for SILENCE_SECONDS; else what the function raises.
    """
    steps, results, errors = [time.monotonic()], list[Result](), list[BaseException]()
    ended = threading.Event()

    def step() -> None:
        steps[0] = time.monotonic()

    def work() -> None:
        try:
            results.append(function(step))
        except BaseException as error:
            errors.append(error)
        ended.set()

    context = contextvars.copy_context()
    threading.Thread(target=context.run, args=(work,), name=f"reading {uri}", daemon=True).start()
    while not ended.wait(max(0.0, steps[0] + SILENCE_SECONDS - time.monotonic())):
        if time.monotonic() - steps[0] >= SILENCE_SECONDS:
            raise _silence(uri)
    if errors:
        raise errors[0]
    return results[0]


def items_within_time[Item](items: Iterable[Item], uri: str) -> Iterator[Item]:
    """Yield items that are read from `uri`; they are made in a thread, at most MAX_READY before they are taken.

    The thread is left behind if it hangs, else it ends before this does.

    Raises:
        InputError: no item has come for SILENCE_SECONDS; else what making them raises.
    """
    ready = queue.Queue[tuple[Item | None, BaseException | None]](MAX_READY)
    stopped = threading.Event()

    def work() -> None:
        end: BaseException = StopIteration()
        try:
            for item in items:
                ready.put((item, None))
                if stopped.is_set():
                    return
        except BaseException as error:
            end = error
        finally:
            if isinstance(items, Iterator) and hasattr(items, "close"):
                items.close()
        ready.put((None, end))

    context = contextvars.copy_context()
    thread = threading.Thread(target=context.run, args=(work,), name=f"reading {uri}", daemon=True)
    thread.start()
    is_hung = False
    try:
        while True:
            try:
                item, end = ready.get(timeout=SILENCE_SECONDS)
            except queue.Empty:
                is_hung = True
                raise _silence(uri) from None
            if isinstance(end, StopIteration):
                return
            if end is not None:
                raise end
            yield cast(Item, item)
    finally:
        stopped.set()
        deadline = time.monotonic() + (0.0 if is_hung else SILENCE_SECONDS)
        while thread.is_alive() and time.monotonic() < deadline:
            with suppress(queue.Empty):
                ready.get(timeout=_STOP_SECONDS)


def _silence(uri: str) -> InputError:
    return InputError(
        f"{uri} has given nothing for {SILENCE_SECONDS:g} s",
        "its disk or network mount hangs: see that `ls` answers there, then run again",
    )
