"""`glint catalogue`: write the catalogue of a folder of captures."""

from shlex import quote
from typing import Annotated

import typer

from glint.flows.cli.output import counted, echo


def catalogue(
    folder: Annotated[
        str,
        typer.Argument(
            metavar="FOLDER", help="Folder with one sub-folder of videos or images per object; also s3://.. or az://.."
        ),
    ],
    out: Annotated[
        str | None, typer.Option("--out", metavar="FILE", help="File to write (default: FOLDER/catalogue.yaml).")
    ] = None,
) -> None:
    """Write a catalogue of the captures in a folder."""
    from glint.storage.catalogue.loading import from_folder, write
    from glint.storage.errors import InputError
    from glint.storage.inputs.digests import exists
    from glint.storage.locations.location import Location

    target = Location.parse(out) if out else Location.parse(folder).child("catalogue.yaml")
    if exists(target):
        raise InputError(f"{target.uri} exists already", "name another file with --out, or remove it")
    left_out = dict[str, str]()
    listed = from_folder(folder, left_out.__setitem__)
    write(listed, target)
    path = out or f"{folder.rstrip('/')}/catalogue.yaml"
    captures = sum(len(item.captures) for item in listed.objects)
    echo(f"{path}: {counted(len(listed.objects), 'object')}, {counted(captures, 'capture')}")
    for name, reason in left_out.items():
        echo(f"left out: {name}: {reason}", colour="yellow")
    echo(f"next: glint check {quote(path)}")
