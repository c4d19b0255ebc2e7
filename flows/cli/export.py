"""`glint export`: a version as files, or as one page."""

from pathlib import Path
from typing import Annotated

import typer

from glint.flows.cli.options import Json, ObjectId, Store, chosen_store, json_line, print_lines
from glint.flows.cli.output import echo


def export(
    object_id: ObjectId,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder to write to; an earlier export in it is replaced. With --page also a file *.html.",
        ),
    ] = None,
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
    is_page: Annotated[
        bool,
        typer.Option(
            "--page", help="Write one HTML file that relights, measures and turns the surface in any browser, offline."
        ),
    ] = False,
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Write a version as files: normals, depth, confidence, lights, meshes, pictures, reports; or for robots."""
    from glint.storage.export.export import export_page
    from glint.storage.export.formats import export_as
    from glint.storage.locations.location import Location

    if is_page and format_name != "files":
        raise typer.BadParameter(f"--page and --format {format_name} exclude each other: leave one out")
    if out is None and not is_page:
        raise typer.BadParameter("there is no folder to write to: add --out DIR, or --page for one HTML file")
    location = Location.parse(chosen_store(store))
    if is_page:
        written = export_page(location, object_id, out or Path(), version)
    else:
        assert out is not None
        written = export_as(format_name, location, object_id, out, version)
    if as_json:
        print_lines([json_line("export", written, object_id="object")])
        return
    files = f"{written.files} file{'' if written.files == 1 else 's'}, {written.size / 1e6:.1f} MB"
    echo(f"{written.object_id} {written.version}: {files} in {written.out}")
    for capture in written.captures if format_name == "files" and not is_page else ():
        echo(f"report: {Path(written.out) / capture / 'report.html'}")
