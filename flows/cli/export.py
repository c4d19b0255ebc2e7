"""`glint export`: a version as files."""

from pathlib import Path
from typing import Annotated

import typer

from glint.flows.cli.options import Json, ObjectId, Store, chosen_store, print_lines
from glint.flows.cli.output import echo


def export(
    object_id: ObjectId,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write to; an earlier export in it is replaced.")
    ],
    version: Annotated[
        str | None, typer.Option(metavar="V", help="The version to export: v1, v2, .. (default: the newest).")
    ] = None,
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="files|bop|pcd",
            help="Everything (files), a BOP dataset of perspective captures in mm (bop), or point clouds (pcd).",
        ),
    ] = "files",
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Write a version as files: normals, depth, confidence, lights, meshes, pictures, reports; or for robots."""
    from dataclasses import asdict

    from glint.storage.export.formats import export_as
    from glint.storage.locations.location import Location

    written = export_as(format_name, Location.parse(chosen_store(store)), object_id, out, version)
    if as_json:
        print_lines([asdict(written)])
        return
    size = f"{written.size / 1e6:.1f} MB"
    echo(f"{written.object_id} {written.version}: {written.files} files, {size} in {written.out}")
    for capture in written.captures if format_name == "files" else ():
        echo(f"report: {Path(written.out) / capture / 'report.html'}")
