"""Processes told apart across restarts and re-used numbers."""

import psutil

SAME_SECONDS = 2.0


def born(pid: int) -> float:
    """Seconds from the machine's start to the process's; unlike times of day, no step of the clock changes them.

    Raises:
        psutil.NoSuchProcess: it is no more.
    """
    return float(psutil.Process(pid).create_time() - psutil.boot_time())


def is_alive(pid: int, seconds: float) -> bool:
    """Whether the process `pid` that was `born` at `seconds` still runs."""
    try:
        # The time of the start is read twice, in whole seconds, and a clock may be set in between.
        same = abs(born(pid) - seconds) < SAME_SECONDS
        return same and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
