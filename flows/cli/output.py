"""Print for people: text of files and names of other people reaches the terminal escaped."""

import typer

from glint.storage.errors import printable


def echo(text: str = "", colour: str | None = None, err: bool = False) -> None:
    """Print lines on standard output, or on standard error with `err`, in a colour where it is a terminal."""
    typer.secho(printable(text, keep="\n\t"), fg=colour, err=err)


def counted(number: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is one."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
