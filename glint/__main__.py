"""The `glint` command, also as `python -m glint`."""

import atexit
import os
import signal
import sys
from contextlib import suppress

EARLY_LINE = b"glint: interrupted; nothing was begun\n"
STANDARD_OUTPUT, STANDARD_ERROR = 1, 2
"""Numbers that processes give their streams."""


class _Leave:
    """Ends the process when all other exit functions have run.

    Taken apart object by object, what Prefect and Dask have loaded takes a second; the system frees it at once.
    """

    def __init__(self) -> None:
        """Begin with the status of an error that nobody catches."""
        self.status, self._process = 1, os.getpid()

    def __call__(self) -> None:
        """Flush and leave; a fork of the process ends in its own way."""
        if os.getpid() != self._process:
            return
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(self.status)


def main() -> None:
    """Run the command line, and end the process."""
    _open_closed_streams()
    # Until the command has its own handler there is nothing to clean up, and Python would print a traceback.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    leave = _Leave()
    atexit.register(leave)  # the first to be registered is the last to be called
    try:
        run_command()
    except SystemExit as ended:
        if ended.code is None or isinstance(ended.code, int):
            leave.status = ended.code or 0
        raise
    leave.status = 0


def run_command() -> None:
    """Run the command line, or say how to install what it needs where only the reading interface is installed."""
    try:
        from glint.flows.cli.main import main as command
    except ModuleNotFoundError as error:
        print(f"glint: the command needs {error.name}", file=sys.stderr)
        print("  -> pip install 'glint[pipeline]'; without it Python can read stores: import glint", file=sys.stderr)
        sys.exit(2)
    command()


def _open_closed_streams() -> None:
    """Open the standard streams that whoever started the command has closed.

    Otherwise a file of a store would get the number of one of them, and what this process and its children print.
    """
    while (handle := os.open(os.devnull, os.O_RDWR)) <= STANDARD_ERROR:
        os.set_inheritable(handle, True)
    os.close(handle)
    for name, handle in (("stdout", STANDARD_OUTPUT), ("stderr", STANDARD_ERROR)):
        if getattr(sys, name) is None:
            setattr(sys, name, open(handle, "w", encoding="utf-8", closefd=False))  # noqa: SIM115


def _end(number: int, frame: object) -> None:
    with suppress(OSError):  # its reader may be gone
        os.write(STANDARD_ERROR, EARLY_LINE)
    os._exit(130)


if __name__ == "__main__":
    main()
