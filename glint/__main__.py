"""The `glint` command, also as `python -m glint`."""

import sys


def main() -> None:
    """Run the command line, or say how to install what it needs where only the reading interface is installed."""
    try:
        from glint.flows.cli.main import main as command
    except ModuleNotFoundError as error:
        print(f"glint: the command needs {error.name}", file=sys.stderr)
        print("  -> pip install 'glint[pipeline]'; without it Python can read stores: import glint", file=sys.stderr)
        sys.exit(2)
    command()


if __name__ == "__main__":
    main()
