"""`glint export`: a version as files."""

from pathlib import Path
from typing import Annotated

import typer

from glint.flows.cli.options import Json, ObjectId, Store, chosen_store, print_lines


def export(
    object_id: ObjectId,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write to; an earlier export in it is replaced.")
    ],
    version: Annotated[
        str | None, typer.Option(metavar="V", help="The version to export: v1, v2, .. (default: the newest).")
    ] = None,
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Write a version as files: normals, depth, confidence, lights, meshes, pictures, reports."""
    from dataclasses import asdict

    from glint.storage.export.export import export as write
    from glint.storage.locations.location import Location

    written = write(Location.parse(chosen_store(store)), object_id, out, version)
    if as_json:
        print_lines([asdict(written)])
        return
    size = f"{written.size / 1e6:.1f} MB"
    typer.echo(f"{written.object_id} {written.version}: {written.files} files, {size} in {written.out}")
    for capture in written.captures:
        typer.echo(f"report: {Path(written.out) / capture / 'report.html'}")
