"""Calls that read inputs, with a time limit: a network mount whose server is gone blocks them forever."""

import contextvars
import threading
import time
from collections.abc import Callable

from glint.storage.errors import InputError

SILENCE_SECONDS = 60.0
"""How long an input may give nothing: a tape or a sleeping disk answers within half of it."""


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
            raise InputError(
                f"{uri} has given nothing for {SILENCE_SECONDS:g} s",
                "its disk or network mount hangs: see that `ls` answers there, then run again",
            )
    if errors:
        raise errors[0]
    return results[0]
