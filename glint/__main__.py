"""The `glint` command, also as `python -m glint`."""

import os
import signal
import sys

EARLY_LINE = b"glint: interrupted; nothing was begun\n"


def main() -> None:
    """Run the command line, or say how to install what it needs where only the reading interface is installed."""
    # Until the command has its own handler there is nothing to clean up, and Python would print a traceback.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    try:
        from glint.flows.cli.main import main as command
    except ModuleNotFoundError as error:
        print(f"glint: the command needs {error.name}", file=sys.stderr)
        print("  -> pip install 'glint[pipeline]'; without it Python can read stores: import glint", file=sys.stderr)
        sys.exit(2)
    command()


def _end(number: int, frame: object) -> None:
    os.write(2, EARLY_LINE)
    os._exit(130)


if __name__ == "__main__":
    main()
