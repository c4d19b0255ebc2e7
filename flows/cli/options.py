"""Options and arguments that several commands share, and their defaults."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Store = Annotated[
    str | None,
    typer.Option(
        "--store",
        metavar="URI",
        help="The store: a folder, s3://bucket/key or az://container/key (default: $GLINT_STORE, else ./glint-store).",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON lines instead of tables, for programs.")]
CatalogueFile = Annotated[
    str, typer.Argument(metavar="CATALOGUE", help="The catalogue's YAML file: a path, s3://.. or az://..")
]


def _object_id(name: str) -> str:
    """Return the name of an object.

    Raises:
        InputError: it is that of a capture.
    """
    from glint.storage.errors import InputError

    object_id, slash, _ = name.partition("/")
    if slash:
        raise InputError(f"{name} is a capture, and this command is of an object", f"name only the object: {object_id}")
    return name


ObjectId = Annotated[
    str, typer.Argument(metavar="OBJECT", help="The object's id in the catalogue.", callback=_object_id)
]
Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only", metavar="OBJECT[/CAPTURE]", help="Process only this object or capture; may be given several times."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Address of a running Dask scheduler, tls://host:8786 (default: a local cluster)."
    ),
]
FramesBudget = Annotated[
    str | None,
    typer.Option(metavar="SIZE", help="Largest size of the cache of frames, such as 200GB (default: no limit)."),
]

DRIFT_HELP = "Warn if the 95th percentile of normal change against the previous version exceeds DEGREES."


def chosen_store(option: str | None) -> str:
    """Return the store of --store, else of $GLINT_STORE, else ./glint-store."""
    return option or os.environ.get("GLINT_STORE") or "glint-store"


def store_option(option: str | None) -> str:
    """Return --store as it was given, quoted, to be appended to the commands that are suggested next."""
    return f" --store {quote(option)}" if option else ""


def budget_bytes(text: str | None) -> int | None:
    """Parse --frames-budget.

    Raises:
        InputError: it is not a size.
    """
    from glint.storage.errors import InputError
    from glint.storage.maintenance.maintain import parse_size

    try:
        return None if text is None else parse_size(text)
    except ValueError as error:
        raise InputError(f"--frames-budget: {error}", "write it as 500MB, 20GB or 1.5TB") from None


def json_line(kind: str, record: "DataclassInstance", **names: str) -> dict[str, Any]:
    """Return a record as a JSON line: its kind, then its fields, some under another name (field=name)."""
    return {"kind": kind, **{names.get(field, field): value for field, value in asdict(record).items()}}


def print_lines(rows: Iterable[Mapping[str, Any]]) -> None:
    """Print rows as JSON lines."""
    for row in rows:
        echo(json.dumps(row, default=str))
